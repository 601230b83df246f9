// Loads and saves a map as a C++ program would: objects by yaml-cpp, cells by libpng.
//
//     load_map OBJECTS PICTURE OUT REPEAT
//
// OBJECTS is a semantic YAML file, PICTURE a map_server picture of grey values and alpha in the mode
// `scale` with the thresholds 1 and 0. Both are loaded into structures and saved as OUT.yaml and
// OUT.png, REPEAT times. Prints one JSON object: the seconds of each load and save, the resident
// memory while the map is held and at its peak [MB], and sums by which answers are compared.

#include <png.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

struct Point {
  double x = 0, y = 0;  // [m]
};
using Ring = std::vector<Point>;

struct Object {
  std::string name;
  Ring outline;  // closed
  std::vector<std::string> tags;
  std::vector<double> confidence;
  std::optional<double> existence, first_seen, last_seen;
};

struct Grid {
  int width = 0, height = 0;
  std::vector<std::int8_t> cells;  // row 0 is the bottom; -1 unknown, 0 free .. 100 occupied
};

struct Map {
  std::vector<Object> objects;
  Grid grid;
};

using File = std::unique_ptr<std::FILE, int (*)(std::FILE *)>;

File open_file(const std::string &path, const char *mode) {
  File file(std::fopen(path.c_str(), mode), std::fclose);
  if (!file) throw std::runtime_error(path + ": cannot be opened");
  return file;
}

// A polygon of one ring in well-known text.
Ring parse_polygon(const std::string &text) {
  const std::size_t start = text.find("((");
  if (text.compare(0, 7, "POLYGON") != 0 || start == std::string::npos)
    throw std::runtime_error("not a polygon: " + text);
  Ring ring;
  const char *at = text.c_str() + start + 2;
  while (true) {
    char *end = nullptr;
    Point point;
    point.x = std::strtod(at, &end);
    point.y = std::strtod(end, &end);
    ring.push_back(point);
    if (*end != ',') break;
    at = end + 1;
  }
  if (ring.front().x != ring.back().x || ring.front().y != ring.back().y)
    ring.push_back(ring.front());
  return ring;
}

std::string polygon_text(const Ring &ring) {
  std::string text = "POLYGON((";
  std::array<char, 64> number{};
  for (std::size_t i = 0; i < ring.size(); ++i) {
    std::snprintf(number.data(), number.size(), "%s%.17g %.17g", i ? ", " : "", ring[i].x,
                  ring[i].y);
    text += number.data();
  }
  return text + "))";
}

std::optional<double> number_at(const YAML::Node &entry, const char *key) {
  const YAML::Node value = entry[key];
  return value ? std::optional<double>(value.as<double>()) : std::nullopt;
}

std::vector<Object> load_objects(const std::string &path) {
  const YAML::Node document = YAML::LoadFile(path);
  std::vector<Object> objects;
  objects.reserve(document.size());
  for (const YAML::Node &entry : document) {
    Object item;
    item.name = entry["name"].as<std::string>();
    item.outline = parse_polygon(entry["shape"].as<std::string>());
    if (const YAML::Node tags = entry["tags"]) item.tags = tags.as<std::vector<std::string>>();
    if (const YAML::Node confidence = entry["confidence"])
      item.confidence = confidence.as<std::vector<double>>();
    item.existence = number_at(entry, "existence");
    item.first_seen = number_at(entry, "first_seen");
    item.last_seen = number_at(entry, "last_seen");
    objects.push_back(std::move(item));
  }
  return objects;
}

void save_objects(const std::vector<Object> &objects, const std::string &path) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::BeginSeq;
  for (const Object &item : objects) {
    out << YAML::BeginMap;
    out << YAML::Key << "name" << YAML::Value << item.name;
    out << YAML::Key << "shape" << YAML::Value << polygon_text(item.outline);
    if (!item.tags.empty())
      out << YAML::Key << "tags" << YAML::Value << YAML::Flow << item.tags;
    if (!item.confidence.empty())
      out << YAML::Key << "confidence" << YAML::Value << YAML::Flow << item.confidence;
    if (item.existence) out << YAML::Key << "existence" << YAML::Value << *item.existence;
    if (item.first_seen) out << YAML::Key << "first_seen" << YAML::Value << *item.first_seen;
    if (item.last_seen) out << YAML::Key << "last_seen" << YAML::Value << *item.last_seen;
    out << YAML::EndMap;
  }
  out << YAML::EndSeq;
  std::ofstream(path) << out.c_str() << "\n";
}

// The cell for grey value c, as map_server reads it in the mode `scale` with thresholds 1 and 0.
std::int8_t cell_of(int grey, int alpha) {
  return alpha == 255 ? static_cast<std::int8_t>(std::lround(100.0 * (255 - grey) / 255)) : -1;
}

Grid load_grid(const std::string &path) {
  const File file = open_file(path, "rb");
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  if (setjmp(png_jmpbuf(png))) throw std::runtime_error(path + ": is not an intact PNG file");
  png_init_io(png, file.get());
  png_read_png(png, info, PNG_TRANSFORM_IDENTITY, nullptr);
  if (png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY_ALPHA || png_get_bit_depth(png, info) != 8)
    throw std::runtime_error(path + ": expected grey values and alpha of 8 bits");
  Grid grid;
  grid.width = static_cast<int>(png_get_image_width(png, info));
  grid.height = static_cast<int>(png_get_image_height(png, info));
  grid.cells.reserve(static_cast<std::size_t>(grid.width) * grid.height);
  std::array<std::int8_t, 512> table{};
  for (int grey = 0; grey < 256; ++grey) {
    table[2 * grey] = cell_of(grey, 0);
    table[2 * grey + 1] = cell_of(grey, 255);
  }
  png_bytepp rows = png_get_rows(png, info);
  for (int row = grid.height - 1; row >= 0; --row)
    for (int col = 0; col < grid.width; ++col)
      grid.cells.push_back(table[2 * rows[row][2 * col] + (rows[row][2 * col + 1] == 255)]);
  png_destroy_read_struct(&png, &info, nullptr);
  return grid;
}

void save_grid(const Grid &grid, const std::string &path) {
  const File file = open_file(path, "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  if (setjmp(png_jmpbuf(png))) throw std::runtime_error(path + ": cannot be written");
  png_init_io(png, file.get());
  png_set_IHDR(png, info, grid.width, grid.height, 8, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  std::vector<png_byte> line(2 * static_cast<std::size_t>(grid.width));
  for (int row = grid.height - 1; row >= 0; --row) {
    const std::int8_t *cells = grid.cells.data() + static_cast<std::size_t>(row) * grid.width;
    for (int col = 0; col < grid.width; ++col) {
      line[2 * col] = cells[col] < 0 ? 205 : static_cast<png_byte>(255 - std::lround(cells[col] * 2.55));
      line[2 * col + 1] = cells[col] < 0 ? 0 : 255;
    }
    png_write_row(png, line.data());
  }
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
}

double area_of(const Ring &ring) {
  double twice = 0;
  for (std::size_t i = 1; i < ring.size(); ++i)
    twice += (ring[i - 1].x - ring[0].x) * (ring[i].y - ring[0].y) -
             (ring[i].x - ring[0].x) * (ring[i - 1].y - ring[0].y);
  return std::abs(twice) / 2;
}

template <typename Work>
double seconds_of(Work work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double resident_mb() {
  long pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return static_cast<double>(resident) * 4096 / 1e6;
}

// Not `ru_maxrss`, in which the process that started this one counts, too.
double peak_mb() {
  std::ifstream status("/proc/self/status");
  std::string word;
  double kilobytes = 0;
  while (status >> word)
    if (word == "VmHWM:") status >> kilobytes;
  return kilobytes * 1024 / 1e6;
}

std::string json_list(const std::vector<double> &values) {
  std::ostringstream text;
  for (std::size_t i = 0; i < values.size(); ++i) text << (i ? ", " : "[") << values[i];
  return text.str() + "]";
}

}  // namespace

int main(int argc, char **argv) {
  if (argc != 5) {
    std::cerr << "usage: load_map OBJECTS PICTURE OUT REPEAT\n";
    return 2;
  }
  try {
    const std::string out = argv[3];
    std::vector<double> loads, saves;
    Map map;
    double resident = 0;
    for (int round = 0; round < std::atoi(argv[4]); ++round) {
      map = Map();
      loads.push_back(seconds_of([&] {
        map.objects = load_objects(argv[1]);
        map.grid = load_grid(argv[2]);
      }));
      if (round == 0) resident = resident_mb();
      saves.push_back(seconds_of([&] {
        save_objects(map.objects, out + ".yaml");
        save_grid(map.grid, out + ".png");
      }));
    }
    std::size_t tags = 0;
    double area = 0, confidence = 0, stamps = 0;
    for (const Object &item : map.objects) {
      tags += item.tags.size();
      area += area_of(item.outline);
      for (const double value : item.confidence) confidence += value;
      stamps += item.last_seen.value_or(0) - item.first_seen.value_or(0);
    }
    const auto &cells = map.grid.cells;
    std::cout.precision(12);
    std::cout << "{\"load\": " << json_list(loads) << ", \"save\": " << json_list(saves)
              << ", \"resident_mb\": " << resident << ", \"peak_mb\": " << peak_mb()
              << ", \"objects\": " << map.objects.size() << ", \"tags\": " << tags
              << ", \"area\": " << area << ", \"confidence\": " << confidence
              << ", \"seen\": " << stamps
              << ", \"free\": " << std::count(cells.begin(), cells.end(), 0)
              << ", \"occupied\": " << std::count(cells.begin(), cells.end(), 100)
              << ", \"unknown\": " << std::count(cells.begin(), cells.end(), -1) << "}\n";
  } catch (const std::exception &error) {
    std::cerr << "load_map: " << error.what() << "\n";
    return 1;
  }
  return 0;
}

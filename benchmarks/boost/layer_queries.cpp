// Questions to many named polygons by an R-tree of boost::geometry, timed.
//
//     layer_queries FOLDER REPEAT
//
// The folder holds the inputs, as plain arrays: corners.i32 and names.i32 (one number per object),
// xy.f64 (all corners, rings open), points.f64 and starts.f64 (x y), areas0.f64 to areas3.f64
// (x0 y0 x1 y1 of each, small ones to large ones), and moves.f64 (x y by which one object after the
// other is moved). Printed are the seconds of each repetition as JSON; answers go to WORK.answer as
// int32, in the same folder, with -1 between those of several questions. Objects are numbered from
// 0. The tree is packed when built, and an R*-tree of at most 16 boxes per node.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <boost/geometry.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>
#include <boost/geometry/index/rtree.hpp>

namespace bg = boost::geometry;
namespace bgi = boost::geometry::index;

using Point = bg::model::d2::point_xy<double>;
using Box = bg::model::box<Point>;
using Polygon = bg::model::polygon<Point, false>;
using Entry = std::pair<Box, std::int32_t>;
using Tree = bgi::rtree<Entry, bgi::rstar<16>>;
using Answer = std::vector<std::int32_t>;

constexpr int area_sizes = 4;
constexpr int nearest_count = 10;

template <typename Number>
std::vector<Number> read(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) {
    std::cerr << path << ": cannot be read\n";
    std::exit(2);
  }
  std::vector<Number> numbers(static_cast<std::size_t>(file.tellg()) / sizeof(Number));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(numbers.data()), numbers.size() * sizeof(Number));
  return numbers;
}

struct Layer {
  std::vector<Polygon> shapes;
  std::vector<double> sizes;
  std::vector<Point> centroids;
  std::vector<std::int32_t> names;
  std::unordered_map<std::int32_t, Answer> of_name;
  Tree tree;

  void put(std::int32_t object, Polygon shape) {
    sizes[object] = bg::area(shape);
    bg::centroid(shape, centroids[object]);
    shapes[object] = std::move(shape);
  }

  Entry entry(std::int32_t object) const {
    return {bg::return_envelope<Box>(shapes[object]), object};
  }

  // The smallest object at a point, of equally small ones the first; -1 where there is none.
  std::int32_t at(const Point& point) const {
    std::int32_t best = -1;
    for (auto hit = tree.qbegin(bgi::intersects(point)); hit != tree.qend(); ++hit) {
      const std::int32_t object = hit->second;
      const bool is_smaller =
          best < 0 || std::make_pair(sizes[object], object) < std::make_pair(sizes[best], best);
      if (is_smaller && bg::covered_by(point, shapes[object])) best = object;
    }
    return best;
  }

  // The objects with a name, or all if it is negative, that meet an area.
  void in(const Box& area, std::int32_t name, Answer& found) const {
    for (auto hit = tree.qbegin(bgi::intersects(area)); hit != tree.qend(); ++hit) {
      const std::int32_t object = hit->second;
      if (name >= 0 && names[object] != name) continue;
      if (bg::intersects(area, shapes[object])) found.push_back(object);
    }
  }

  // The objects with a name that are nearest to a point, by the distance to their shapes.
  void nearest(const Point& point, std::int32_t name, Answer& found) const {
    std::vector<std::pair<double, std::int32_t>> best;  // a heap, the farthest on top
    const auto is_named = [&](const Entry& entry) { return names[entry.second] == name; };
    const auto asked = bgi::nearest(point, shapes.size()) && bgi::satisfies(is_named);
    for (auto hit = tree.qbegin(asked); hit != tree.qend(); ++hit) {
      const bool is_full = best.size() == nearest_count;
      if (is_full && bg::distance(point, hit->first) > best.front().first) break;
      best.emplace_back(bg::distance(point, shapes[hit->second]), hit->second);
      std::push_heap(best.begin(), best.end());
      if (is_full) {
        std::pop_heap(best.begin(), best.end());
        best.pop_back();
      }
    }
    std::sort_heap(best.begin(), best.end());
    for (const auto& [distance, object] : best) found.push_back(object);
  }
};

Layer read_layer(const std::string& folder) {
  const auto corners = read<std::int32_t>(folder + "/corners.i32");
  const auto xy = read<double>(folder + "/xy.f64");
  Layer layer;
  layer.names = read<std::int32_t>(folder + "/names.i32");
  layer.shapes.resize(corners.size());
  layer.sizes.resize(corners.size());
  layer.centroids.resize(corners.size());
  std::size_t at = 0;
  for (std::size_t object = 0; object < corners.size(); ++object) {
    Polygon shape;
    for (int corner = 0; corner < corners[object]; ++corner, at += 2) {
      shape.outer().emplace_back(xy[at], xy[at + 1]);
    }
    bg::correct(shape);
    layer.put(static_cast<std::int32_t>(object), std::move(shape));
    layer.of_name[layer.names[object]].push_back(static_cast<std::int32_t>(object));
  }
  return layer;
}

Tree packed(const Layer& layer) {
  std::vector<Entry> entries;
  for (std::size_t object = 0; object < layer.shapes.size(); ++object) {
    entries.push_back(layer.entry(static_cast<std::int32_t>(object)));
  }
  return Tree(entries);
}

Polygon moved_by(const Polygon& shape, double dx, double dy) {
  Polygon moved = shape;
  for (auto& point : moved.outer()) {
    point.x(point.x() + dx);
    point.y(point.y() + dy);
  }
  return moved;
}

// One object after the other is taken out, put back elsewhere, and asked for at its new centroid.
void move_and_ask(Layer& layer, const std::vector<double>& moves, Answer& found) {
  for (std::size_t i = 0; i < moves.size() / 2; ++i) {
    const auto object = static_cast<std::int32_t>(i % layer.shapes.size());
    layer.tree.remove(layer.entry(object));
    layer.put(object, moved_by(layer.shapes[object], moves[2 * i], moves[2 * i + 1]));
    layer.tree.insert(layer.entry(object));
    found.push_back(layer.at(layer.centroids[object]));
  }
}

int main(int count, char** words) {
  if (count != 3) {
    std::cerr << "usage: layer_queries FOLDER REPEAT\n";
    return 2;
  }
  const std::string folder = words[1];
  const int repeat = std::atoi(words[2]);
  Layer layer = read_layer(folder);
  const auto points = read<double>(folder + "/points.f64");
  const auto starts = read<double>(folder + "/starts.f64");
  const auto moves = read<double>(folder + "/moves.f64");
  const std::int32_t name = layer.names.front();

  std::map<std::string, std::vector<double>> seconds;
  const auto time = [&](const std::string& work, const std::function<void(Answer&)>& ask) {
    Answer answer;
    for (int run = 0; run < repeat; ++run) {
      answer.clear();
      const auto start = std::chrono::steady_clock::now();
      ask(answer);
      const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
      seconds[work].push_back(passed.count());
    }
    std::ofstream file(folder + "/" + work + ".answer", std::ios::binary);
    file.write(reinterpret_cast<const char*>(answer.data()), answer.size() * sizeof(answer[0]));
  };

  time("build", [&](Answer&) { layer.tree = packed(layer); });
  time("points", [&](Answer& found) {
    found.reserve(points.size() / 2);
    for (std::size_t i = 0; i < points.size(); i += 2) {
      found.push_back(layer.at({points[i], points[i + 1]}));
    }
  });
  for (int size = 0; size < area_sizes; ++size) {
    const std::string number = std::to_string(size);
    const auto areas = read<double>(folder + "/areas" + number + ".f64");
    const auto ask_all = [&](std::int32_t asked_name, Answer& found) {
      for (std::size_t i = 0; i < areas.size(); i += 4) {
        layer.in(Box({areas[i], areas[i + 1]}, {areas[i + 2], areas[i + 3]}), asked_name, found);
        found.push_back(-1);
      }
    };
    time("area" + number, [&](Answer& found) { ask_all(-1, found); });
    time("named" + number, [&](Answer& found) { ask_all(name, found); });
  }
  // As ours: the centroids are the answer; the numbers tell them apart.
  time("name", [&](Answer& found) {
    std::vector<Point> places;
    for (const std::int32_t object : layer.of_name[name]) {
      places.push_back(layer.centroids[object]);
      found.push_back(object);
    }
  });
  time("nearest", [&](Answer& found) {
    for (std::size_t i = 0; i < starts.size(); i += 2) {
      layer.nearest({starts[i], starts[i + 1]}, name, found);
      found.push_back(-1);
    }
  });
  time("moves", [&](Answer& found) { move_and_ask(layer, moves, found); });

  std::cout << "{\"version\": \"" << BOOST_VERSION / 100000 << "." << BOOST_VERSION / 100 % 1000
            << "\", \"seconds\": {";
  const char* comma = "";
  for (const auto& [work, runs] : seconds) {
    std::cout << comma << "\"" << work << "\": [";
    for (std::size_t run = 0; run < runs.size(); ++run) {
      std::cout << (run ? ", " : "") << runs[run];
    }
    std::cout << "]";
    comma = ", ";
  }
  std::cout << "}}\n";
  return 0;
}

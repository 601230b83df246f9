// Questions to many named polygons by an R-tree of boost::geometry, timed.
//
//     layer_queries FOLDER
//
// The folder holds the inputs, as plain arrays: corners.i32 and names.i32 (one number per object),
// xy.f64 (all corners, rings open), points.f64 and starts.f64 (x y), areas0.f64 to areas3.f64
// (x0 y0 x1 y1 of each, small ones to large ones), and moves.f64 (x y by which the first objects
// are moved, and then back again). The first line printed is the version of Boost. Then it reads
// the names of works, one per line: each is done once, its answers go to WORK.answer as int32, in
// the same folder, with -1 after that to each question, and then again and again for 20 ms, and
// the mean seconds are printed. Objects are numbered from 0. The tree is packed when built, and an
// R*-tree of at most 16 boxes per node.

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
constexpr std::size_t single_points = 1000;  // that are asked for one by one
constexpr double long_enough = 0.02;         // seconds of a measured run

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

struct Change {
  std::int32_t object;
  Polygon shape;
};

// The first objects moved one after the other, and then back.
std::vector<Change> read_changes(const Layer& layer, const std::string& folder) {
  const auto moves = read<double>(folder + "/moves.f64");
  std::vector<Change> there, back;
  for (std::size_t i = 0; i < moves.size() / 2; ++i) {
    const auto object = static_cast<std::int32_t>(i);
    there.push_back({object, moved_by(layer.shapes[i], moves[2 * i], moves[2 * i + 1])});
    back.push_back({object, layer.shapes[i]});
  }
  there.insert(there.end(), back.begin(), back.end());
  return there;
}

// One object after the other is taken out, put back elsewhere, and asked for at its new centroid.
void move_and_ask(Layer& layer, const std::vector<Change>& changes, Answer& found) {
  for (const auto& [object, shape] : changes) {
    layer.tree.remove(layer.entry(object));
    layer.put(object, shape);
    layer.tree.insert(layer.entry(object));
    found.push_back(layer.at(layer.centroids[object]));
    found.push_back(-1);
  }
}

double seconds_of(const std::function<void(Answer&)>& ask, const std::string& path) {
  Answer answer;
  ask(answer);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(answer.data()), answer.size() * sizeof(answer[0]));
  file.close();
  const auto start = std::chrono::steady_clock::now();
  std::chrono::duration<double> passed{};
  int calls = 0;
  while (passed.count() < long_enough) {
    answer.clear();
    ask(answer);
    ++calls;
    passed = std::chrono::steady_clock::now() - start;
  }
  return passed.count() / calls;
}

int main(int count, char** words) {
  if (count != 2) {
    std::cerr << "usage: layer_queries FOLDER\n";
    return 2;
  }
  const std::string folder = words[1];
  Layer layer = read_layer(folder);
  layer.tree = packed(layer);
  const auto points = read<double>(folder + "/points.f64");
  const auto starts = read<double>(folder + "/starts.f64");
  const auto changes = read_changes(layer, folder);
  const std::int32_t name = layer.names.front();

  std::map<std::string, std::function<void(Answer&)>> works;
  works["points"] = [&](Answer& found) {
    found.reserve(points.size() / 2 + 1);
    for (std::size_t i = 0; i < points.size(); i += 2) {
      found.push_back(layer.at({points[i], points[i + 1]}));
    }
    found.push_back(-1);
  };
  works["point"] = [&](Answer& found) {
    for (std::size_t i = 0; i < std::min(points.size(), 2 * single_points); i += 2) {
      found.push_back(layer.at({points[i], points[i + 1]}));
      found.push_back(-1);
    }
  };
  for (int size = 0; size < area_sizes; ++size) {
    const std::string number = std::to_string(size);
    const auto areas = read<double>(folder + "/areas" + number + ".f64");
    const auto ask_all = [&layer, areas](std::int32_t asked_name, Answer& found) {
      for (std::size_t i = 0; i < areas.size(); i += 4) {
        layer.in(Box({areas[i], areas[i + 1]}, {areas[i + 2], areas[i + 3]}), asked_name, found);
        found.push_back(-1);
      }
    };
    works["area" + number] = [=](Answer& found) { ask_all(-1, found); };
    works["named" + number] = [=](Answer& found) { ask_all(name, found); };
  }
  // As ours: the centroids are the answer; the numbers tell them apart.
  works["name"] = [&](Answer& found) {
    std::vector<Point> places;
    for (const std::int32_t object : layer.of_name[name]) {
      places.push_back(layer.centroids[object]);
      found.push_back(object);
    }
    found.push_back(-1);
  };
  works["nearest"] = [&](Answer& found) {
    for (std::size_t i = 0; i < starts.size(); i += 2) {
      layer.nearest({starts[i], starts[i + 1]}, name, found);
      found.push_back(-1);
    }
  };
  works["moved"] = [&](Answer& found) { move_and_ask(layer, changes, found); };

  std::cout << BOOST_VERSION / 100000 << "." << BOOST_VERSION / 100 % 1000 << std::endl;
  std::string work;
  while (std::getline(std::cin, work)) {
    std::cout << seconds_of(works.at(work), folder + "/" + work + ".answer") << std::endl;
  }
  return 0;
}

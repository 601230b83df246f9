// The perception of the first Hypermap program, with PCL: what a frame's boxes hold, on the floor.
//
//   region_growing FRAME REPEAT
//
// FRAME is a binary file, little-endian: height, width and number of boxes (int32); the organised
// cloud in the optical frame, row by row (float32, 3 per pixel, NaN for no return); map_T_camera,
// row by row (float64, 16); and of each box xmin, ymin, xmax, ymax (int32), the last two without.
//
// Prints JSON: the seconds of each run, of each box the sizes of its clusters, the pixels of the
// largest one and its footprint, and the visible area. Files are read before the clock starts.

// Not to be compiled for one processor only (-march=native): Debian's library is built for any
// x86-64, and memory that one side allocates could not be freed by the other.

#include <pcl/features/normal_3d.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/region_growing.h>
#include <pcl/surface/convex_hull.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;
using Tree = pcl::search::KdTree<pcl::PointXYZ>;

constexpr int kNormalNeighbors = 50;
constexpr int kRegionNeighbors = 30;
constexpr float kSmoothness = 20.0f / 180.0f * static_cast<float>(M_PI);
constexpr float kCurvatureThreshold = 1.0f;
constexpr int kMinCluster = 50;
constexpr int kMaxCluster = 1000000;
constexpr float kVoxelSize = 0.01f;

struct Box {
  std::int32_t xmin, ymin, xmax, ymax;
};

struct Frame {
  std::int32_t height, width;
  std::vector<float> xyz;
  Eigen::Matrix4d map_T_camera;
  std::vector<Box> boxes;
};

struct Object {
  std::vector<std::size_t> cluster_sizes;
  std::vector<int> pixels;  // of the largest cluster
  Cloud footprint;
};

struct Answer {
  std::vector<Object> objects;
  Cloud visible_area;
};

template <typename T>
void Read(std::ifstream& file, T* values, std::size_t count) {
  file.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
  if (!file) throw std::runtime_error("the frame's file is too short");
}

Frame Load(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot open " + path);
  Frame frame;
  std::int32_t boxes;
  Read(file, &frame.height, 1);
  Read(file, &frame.width, 1);
  Read(file, &boxes, 1);
  frame.xyz.resize(3 * static_cast<std::size_t>(frame.height) * frame.width);
  Read(file, frame.xyz.data(), frame.xyz.size());
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
  Read(file, pose.data(), 16);
  frame.map_T_camera = pose;
  frame.boxes.resize(boxes);
  Read(file, frame.boxes.data(), frame.boxes.size());
  return frame;
}

// The convex hull of points on the floor, of one point per voxel.
Cloud Footprint(const Cloud& cloud, const Eigen::Matrix4f& map_T_camera) {
  const auto on_floor = std::make_shared<Cloud>();
  on_floor->reserve(cloud.size());
  for (const auto& point : cloud) {
    const Eigen::Vector4f in_map = map_T_camera * Eigen::Vector4f(point.x, point.y, point.z, 1);
    on_floor->push_back(pcl::PointXYZ(in_map.x(), in_map.y(), 0));
  }
  const auto thinned = std::make_shared<Cloud>();
  pcl::VoxelGrid<pcl::PointXYZ> grid;
  grid.setInputCloud(on_floor);
  grid.setLeafSize(kVoxelSize, kVoxelSize, kVoxelSize);
  grid.filter(*thinned);
  Cloud shape;
  if (thinned->size() < 3) return shape;
  pcl::ConvexHull<pcl::PointXYZ> hull;
  hull.setInputCloud(thinned);
  hull.setDimension(2);
  hull.reconstruct(shape);
  return shape;
}

Object Grow(const Cloud::Ptr& cloud, const Normals::Ptr& normals, const pcl::IndicesPtr& own) {
  pcl::RegionGrowing<pcl::PointXYZ, pcl::Normal> growing;
  growing.setInputCloud(cloud);
  growing.setIndices(own);
  growing.setInputNormals(normals);
  growing.setSearchMethod(std::make_shared<Tree>());
  growing.setNumberOfNeighbours(kRegionNeighbors);
  growing.setSmoothnessThreshold(kSmoothness);
  growing.setCurvatureThreshold(kCurvatureThreshold);
  growing.setMinClusterSize(kMinCluster);
  growing.setMaxClusterSize(kMaxCluster);
  std::vector<pcl::PointIndices> clusters;
  growing.extract(clusters);
  Object object;
  const pcl::PointIndices* largest = nullptr;
  for (const auto& cluster : clusters) {
    object.cluster_sizes.push_back(cluster.indices.size());
    if (!largest || cluster.indices.size() > largest->indices.size()) largest = &cluster;
  }
  if (largest) object.pixels.assign(largest->indices.begin(), largest->indices.end());
  return object;
}

Answer Observe(const Frame& frame) {
  // Only what has a depth takes part; the pixel of each point is kept.
  const auto cloud = std::make_shared<Cloud>();
  std::vector<int> pixel_of, point_of(frame.xyz.size() / 3, -1);
  for (std::size_t pixel = 0; pixel < point_of.size(); ++pixel) {
    const float* p = &frame.xyz[3 * pixel];
    if (!std::isfinite(p[2])) continue;
    point_of[pixel] = static_cast<int>(pixel_of.size());
    pixel_of.push_back(static_cast<int>(pixel));
    cloud->push_back(pcl::PointXYZ(p[0], p[1], p[2]));
  }

  const auto normals = std::make_shared<Normals>();
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setSearchMethod(std::make_shared<Tree>());
  estimation.setInputCloud(cloud);
  estimation.setKSearch(kNormalNeighbors);
  estimation.compute(*normals);

  const Eigen::Matrix4f map_T_camera = frame.map_T_camera.cast<float>();
  Answer answer;
  for (const Box& box : frame.boxes) {
    const auto own = std::make_shared<pcl::Indices>();
    for (int v = std::max(box.ymin, 0); v < std::min(box.ymax, frame.height); ++v)
      for (int u = std::max(box.xmin, 0); u < std::min(box.xmax, frame.width); ++u)
        if (point_of[v * frame.width + u] >= 0) own->push_back(point_of[v * frame.width + u]);
    Object object;
    if (own->size() >= static_cast<std::size_t>(kMinCluster)) object = Grow(cloud, normals, own);
    Cloud points;
    for (int& pixel : object.pixels) {
      points.push_back((*cloud)[pixel]);
      pixel = pixel_of[pixel];
    }
    object.footprint = Footprint(points, map_T_camera);
    answer.objects.push_back(object);
  }
  answer.visible_area = Footprint(*cloud, map_T_camera);
  return answer;
}

template <typename Values>
void PrintList(const Values& values) {
  const char* between = "[";
  for (const auto& value : values) {
    std::cout << between << value;
    between = ",";
  }
  std::cout << (values.empty() ? "[]" : "]");
}

void PrintShape(const Cloud& shape) {
  const char* between = "[";
  for (const auto& point : shape) {
    std::cout << between << "[" << point.x << "," << point.y << "]";
    between = ",";
  }
  std::cout << (shape.empty() ? "[]" : "]");
}

void Print(const std::vector<double>& seconds, const Answer& answer) {
  std::cout.precision(9);
  std::cout << "{\"version\":\"" << PCL_VERSION_PRETTY << "\",\"seconds\":";
  PrintList(seconds);
  std::cout << ",\"objects\":[";
  const char* between = "";
  for (const Object& object : answer.objects) {
    std::cout << between << "{\"cluster_sizes\":";
    PrintList(object.cluster_sizes);
    std::cout << ",\"pixels\":";
    PrintList(object.pixels);
    std::cout << ",\"footprint\":";
    PrintShape(object.footprint);
    std::cout << "}";
    between = ",";
  }
  std::cout << "],\"visible_area\":";
  PrintShape(answer.visible_area);
  std::cout << "}\n";
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: region_growing FRAME REPEAT");
  const Frame frame = Load(argv[1]);
  std::vector<double> seconds;
  Answer answer;
  for (int run = 0; run < std::stoi(argv[2]); ++run) {
    const auto start = std::chrono::steady_clock::now();
    answer = Observe(frame);
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
    seconds.push_back(passed.count());
  }
  Print(seconds, answer);
} catch (const std::exception& error) {
  std::cerr << "region_growing: " << error.what() << "\n";
  return 1;
}

#include "rgbd/pose/picture.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <boost/graph/prim_minimum_spanning_tree.hpp>
#include <boost/iterator/counting_iterator.hpp>
#include <boost/iterator/transform_iterator.hpp>
#include <boost/property_map/function_property_map.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

namespace sherlog::rgbd {
namespace {

// The complete graph of poses as Boost.Graph sees it. Only the weights of the edges out of one vertex are there at a
// time: those of the last one asked for.
class PoseGraph {
 public:
  using vertex_descriptor = std::size_t;
  using edge_descriptor = std::pair<std::size_t, std::size_t>;
  using directed_category = boost::directed_tag;
  using edge_parallel_category = boost::disallow_parallel_edge_tag;
  struct traversal_category : boost::vertex_list_graph_tag, boost::incidence_graph_tag {};
  using vertices_size_type = std::size_t;
  using edges_size_type = std::size_t;
  using degree_size_type = std::size_t;
  using vertex_iterator = boost::counting_iterator<std::size_t>;
  struct EdgeTo {
    std::size_t from = 0;
    edge_descriptor operator()(std::size_t to) const { return {from, to}; }
  };
  using out_edge_iterator = boost::transform_iterator<EdgeTo, vertex_iterator>;

  explicit PoseGraph(std::span<const PoseDescriptor> poses) : rows_(poses.size(), kPoseLength) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Map<const Eigen::RowVectorXf> pose(poses[i].data(), kPoseLength);
      auto row = rows_.row(static_cast<Eigen::Index>(i));
      row = pose.cast<double>();
      row.array() -= row.mean();
      const double norm = row.norm();
      if (norm > 0) row /= norm;
    }
  }

  // 1 - correlation of an edge out of the vertex whose edges were asked for last.
  double weight(const edge_descriptor& edge) const { return weights_[static_cast<Eigen::Index>(edge.second)]; }

  friend std::size_t num_vertices(const PoseGraph& graph) { return static_cast<std::size_t>(graph.rows_.rows()); }
  friend std::pair<vertex_iterator, vertex_iterator> vertices(const PoseGraph& graph) {
    return {vertex_iterator(0), vertex_iterator(num_vertices(graph))};
  }
  friend std::size_t out_degree(std::size_t, const PoseGraph& graph) { return num_vertices(graph); }
  friend std::size_t source(const edge_descriptor& edge, const PoseGraph&) { return edge.first; }
  friend std::size_t target(const edge_descriptor& edge, const PoseGraph&) { return edge.second; }
  friend std::pair<out_edge_iterator, out_edge_iterator> out_edges(std::size_t v, const PoseGraph& graph) {
    const auto row = static_cast<Eigen::Index>(v);
    graph.weights_.noalias() = graph.rows_ * graph.rows_.row(row).transpose();
    graph.weights_ = (1 - graph.weights_.array()).max(0.0);    // of equal poses rounding may say less
    graph.weights_[row] = std::numeric_limits<double>::max();  // no way from a pose to itself
    const auto [begin, end] = vertices(graph);
    return {out_edge_iterator(begin, EdgeTo{v}), out_edge_iterator(end, EdgeTo{v})};
  }

 private:
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows_;  // mean 0, norm 1, or all 0
  mutable Eigen::VectorXd weights_;
};

using Neighbours = std::vector<std::vector<std::pair<double, std::size_t>>>;  // weight, pose

Neighbours neighbours_of(std::size_t count, std::span<const PoseEdge> tree) {
  Neighbours neighbours(count);
  for (const PoseEdge& edge : tree) {
    neighbours[edge.a].emplace_back(edge.weight, edge.b);
    neighbours[edge.b].emplace_back(edge.weight, edge.a);
  }
  for (auto& list : neighbours) std::ranges::sort(list);
  return neighbours;
}

// The path from `start` to the pose that is farthest from it, that one first; of equal ones the least number.
std::vector<std::size_t> farthest_path(const Neighbours& neighbours, std::size_t start) {
  std::vector<double> distance(neighbours.size(), -1);
  std::vector<std::size_t> parent(neighbours.size(), start), stack = {start};
  distance[start] = 0;
  while (!stack.empty()) {
    const std::size_t here = stack.back();
    stack.pop_back();
    for (const auto& [weight, next] : neighbours[here]) {
      if (distance[next] >= 0) continue;
      distance[next] = distance[here] + weight;
      parent[next] = here;
      stack.push_back(next);
    }
  }
  std::vector<std::size_t> path = {static_cast<std::size_t>(std::ranges::max_element(distance) - distance.begin())};
  while (path.back() != start) path.push_back(parent[path.back()]);
  return path;
}

std::vector<std::size_t> longest_path(const Neighbours& neighbours) {
  if (neighbours.empty()) return {};
  return farthest_path(neighbours, farthest_path(neighbours, 0).front());
}

constexpr int kCell = 4, kTile = kCell * static_cast<int>(kPoseCells) + 4;

std::string tile(const PoseDescriptor& pose, int left, int top) {
  const float most = std::max(*std::ranges::max_element(pose), 1e-9F);
  std::string svg = fmt::format("<path transform=\"translate({},{})\" stroke=\"black\" d=\"", left + 2, top + 2);
  for (std::size_t k = 0; k < kPoseLength; ++k) {
    if (pose[k] < 0.25F * most) continue;
    const std::size_t cell = k / kPoseDirections;
    const double x = kCell * (static_cast<double>(cell % kPoseCells) + 0.5),
                 y = kCell * (static_cast<double>(cell / kPoseCells) + 0.5);
    const double angle = std::numbers::pi / 4 * static_cast<double>(k % kPoseDirections);
    const double dx = 0.5 * kCell * std::cos(angle), dy = -0.5 * kCell * std::sin(angle);
    svg += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", x - dx, y - dy, x + dx, y + dy);
  }
  return svg + "\"/>\n";
}

std::string begin_svg(int width, int height) {
  return fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\">\n", width, height);
}

// Places of a tree's vertices on a grid. The path is row 0; a branch goes away from it, a row for each edge. The first
// child stands in its parent's column, every other one in the next that is free on its side.
struct Layout {
  struct Place {
    int column = 0, row = 0;
  };
  std::vector<Place> places;
  std::vector<std::pair<std::size_t, std::size_t>> branches;  // edges that are not on the path
  int columns = 0, top = 0, bottom = 0;                       // rows from top to bottom
};

Layout lay_out(const Neighbours& neighbours, std::span<const std::size_t> path) {
  Layout layout;
  layout.places.resize(neighbours.size());
  std::vector<bool> seen(neighbours.size());
  for (const std::size_t v : path) seen[v] = true;
  struct Step {
    std::size_t parent = 0, child = 0;
    bool is_first = false;
  };
  std::vector<Step> stack;
  for (const std::size_t knot : path) {
    layout.places[knot] = {layout.columns, 0};
    int free[2] = {layout.columns, layout.columns};
    int side = 0;
    for (const auto& branch : neighbours[knot]) {
      if (seen[branch.second]) continue;
      stack.push_back({knot, branch.second, false});
      while (!stack.empty()) {
        const auto [parent, child, is_first] = stack.back();
        stack.pop_back();
        seen[child] = true;
        layout.branches.emplace_back(parent, child);
        Layout::Place& place = layout.places[child];
        place.column = is_first ? layout.places[parent].column : free[side]++;
        place.row = layout.places[parent].row + (side == 0 ? -1 : 1);
        layout.top = std::min(layout.top, place.row);
        layout.bottom = std::max(layout.bottom, place.row);
        const std::size_t first = stack.size();
        for (const auto& next : neighbours[child]) {
          if (!seen[next.second]) stack.push_back({child, next.second, stack.size() == first});
        }
        std::reverse(stack.begin() + static_cast<std::ptrdiff_t>(first), stack.end());
      }
      side = 1 - side;
    }
    layout.columns = std::max({free[0], free[1], layout.columns + 1});
  }
  return layout;
}

}  // namespace

std::vector<PoseEdge> spanning_tree(std::span<const PoseDescriptor> poses) {
  std::vector<PoseEdge> tree;
  if (poses.size() < 2) return tree;
  const PoseGraph graph(poses);
  std::vector<std::size_t> predecessor(poses.size());
  std::vector<double> distance(poses.size());
  boost::prim_minimum_spanning_tree(graph, predecessor.data(),
                                    boost::root_vertex(std::size_t{0})
                                        .weight_map(boost::make_function_property_map<PoseGraph::edge_descriptor>(
                                            [&](const PoseGraph::edge_descriptor& edge) { return graph.weight(edge); }))
                                        .distance_map(distance.data())
                                        .vertex_index_map(boost::typed_identity_property_map<std::size_t>()));
  for (std::size_t v = 1; v < poses.size(); ++v) {
    const auto [a, b] = std::minmax(v, predecessor[v]);
    tree.push_back({a, b, distance[v]});
  }
  std::ranges::sort(tree, {}, [](const PoseEdge& edge) { return std::tuple(edge.weight, edge.a, edge.b); });
  return tree;
}

std::vector<std::size_t> longest_path(std::size_t count, std::span<const PoseEdge> tree) {
  return longest_path(neighbours_of(count, tree));
}

std::vector<std::size_t> preorder(std::size_t count, std::span<const PoseEdge> tree) {
  std::vector<std::size_t> order;
  if (count == 0) return order;
  const Neighbours neighbours = neighbours_of(count, tree);
  std::vector<std::size_t> stack = {longest_path(neighbours).front()};
  std::vector<bool> seen(count);
  while (!stack.empty()) {
    const std::size_t here = stack.back();
    stack.pop_back();
    if (seen[here]) continue;
    seen[here] = true;
    order.push_back(here);
    for (auto next = neighbours[here].rbegin(); next != neighbours[here].rend(); ++next) {
      if (!seen[next->second]) stack.push_back(next->second);
    }
  }
  return order;
}

std::string pose_picture(std::span<const PoseDescriptor> poses, std::span<const std::size_t> order) {
  std::uint32_t levels = 0;
  while ((std::size_t{1} << (2 * levels)) < order.size()) ++levels;
  std::string svg = begin_svg(kTile << levels, kTile << levels);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Pixel place = hilbert_pixel(levels, static_cast<std::uint32_t>(i));
    svg += tile(poses[order[i]], place.x * kTile, place.y * kTile);
  }
  return svg + "</svg>\n";
}

std::string tree_picture(std::span<const PoseDescriptor> poses, std::span<const PoseEdge> tree) {
  constexpr int kRow = kTile * 3 / 2;
  const Neighbours neighbours = neighbours_of(poses.size(), tree);
  const std::vector<std::size_t> path = longest_path(neighbours);
  const Layout layout = lay_out(neighbours, path);
  const auto left = [&](std::size_t v) { return layout.places[v].column * kTile; };
  const auto top = [&](std::size_t v) { return (layout.places[v].row - layout.top) * kRow; };
  const auto middle = [&](std::size_t v) { return fmt::format("{} {}", left(v) + kTile / 2, top(v) + kTile / 2); };
  std::string svg = begin_svg(layout.columns * kTile, (layout.bottom - layout.top) * kRow + kTile);
  svg += "<path class=\"branches\" fill=\"none\" stroke=\"silver\" d=\"";
  for (const auto& [parent, child] : layout.branches) svg += "M" + middle(parent) + "L" + middle(child);
  svg += "\"/>\n<path class=\"longest\" fill=\"none\" stroke=\"tomato\" stroke-width=\"3\" d=\"";
  for (std::size_t i = 0; i < path.size(); ++i) svg += (i == 0 ? "M" : "L") + middle(path[i]);
  svg += "\"/>\n";
  for (std::size_t v = 0; v < poses.size(); ++v) svg += tile(poses[v], left(v), top(v));
  return svg + "</svg>\n";
}

}  // namespace sherlog::rgbd

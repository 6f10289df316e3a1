#include "inference/soft_cliques.h"

#include <algorithm>
#include <map>

namespace sherlog {
namespace {

constexpr std::uint64_t kMaxSteps = 20'000'000;
constexpr std::size_t kMaxWeights = 8;  // the most frequent weights are tried; rare ones make no large cliques

struct Neighbour {
  std::uint32_t vertex, edge;
};

class CliqueGrower {
 public:
  CliqueGrower(std::uint32_t vertex_count, std::span<SoftEdge> edges) : edges_(edges), neighbours_(vertex_count) {
    for (std::uint32_t e = 0; e < edges.size(); ++e) {
      neighbours_[edges[e].a].push_back({edges[e].b, e});
      neighbours_[edges[e].b].push_back({edges[e].a, e});
    }
    for (auto& list : neighbours_) std::ranges::sort(list, {}, &Neighbour::vertex);
  }

  // Cliques of edges of at least `weight`, each begun at an edge of exactly this weight.
  void grow_all(double weight, std::vector<SoftClique>& cliques) {
    for (std::uint32_t e = 0; e < edges_.size() && steps_ < kMaxSteps; ++e) {
      if (edges_[e].weight != weight) continue;
      std::vector<std::uint32_t> members = grow(edges_[e].a, edges_[e].b, weight);
      if (members.size() < 3) continue;
      for (std::size_t i = 0; i < members.size(); ++i) {
        for (std::size_t j = i + 1; j < members.size(); ++j) edges_[edge(members[i], members[j])].weight -= weight;
      }
      cliques.push_back({weight, std::move(members)});
    }
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  std::uint32_t edge(std::uint32_t a, std::uint32_t b) const {
    const auto& list = neighbours_[a];
    const auto place = std::ranges::lower_bound(list, b, {}, &Neighbour::vertex);
    return place != list.end() && place->vertex == b ? place->edge : kNone;
  }
  bool joined(std::uint32_t a, std::uint32_t b, double weight) const {
    const std::uint32_t e = edge(a, b);
    return e != kNone && edges_[e].weight >= weight;
  }

  std::vector<std::uint32_t> grow(std::uint32_t a, std::uint32_t b, double weight) {
    std::vector<std::uint32_t> members{a, b};
    for (const Neighbour& n : neighbours_[a]) {
      ++steps_;
      if (n.vertex == b || edges_[n.edge].weight < weight) continue;
      const bool fits = std::all_of(members.begin() + 1, members.end(), [&](std::uint32_t m) {
        ++steps_;
        return joined(n.vertex, m, weight);
      });
      if (fits) members.push_back(n.vertex);
    }
    std::ranges::sort(members);
    return members;
  }

  std::span<SoftEdge> edges_;
  std::vector<std::vector<Neighbour>> neighbours_;
  std::uint64_t steps_ = 0;
};

}  // namespace

std::vector<SoftClique> find_soft_cliques(std::uint32_t vertex_count, std::span<SoftEdge> edges) {
  std::vector<SoftClique> cliques;
  std::map<double, std::size_t> count;
  for (const SoftEdge& e : edges) ++count[e.weight];
  std::vector<std::pair<std::size_t, double>> order;
  for (const auto& [weight, n] : count) {
    if (n >= 3) order.push_back({n, weight});
  }
  std::ranges::sort(
      order, [](const auto& x, const auto& y) { return x.first != y.first ? x.first > y.first : x.second < y.second; });
  if (order.size() > kMaxWeights) order.resize(kMaxWeights);
  CliqueGrower grower(vertex_count, edges);
  for (const auto& [n, weight] : order) grower.grow_all(weight, cliques);
  return cliques;
}

}  // namespace sherlog

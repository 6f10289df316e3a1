#include "rgbd/pose/picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <regex>
#include <set>

namespace sherlog::rgbd {
namespace {

using Random = std::mt19937_64;

// Skeletons of eight straight bones; those of a kind differ by a few pixels and degrees.
std::vector<PoseDescriptor> poses_of_kinds(std::size_t count, std::size_t kinds, Random& random) {
  std::uniform_real_distribution<double> anywhere(0, 100), angle(0, std::numbers::pi), wobble(-1, 1);
  struct Bone {
    double x = 0, y = 0, angle = 0;
  };
  std::vector<std::array<Bone, 8>> skeletons(kinds);
  for (auto& skeleton : skeletons) {
    for (Bone& bone : skeleton) bone = {anywhere(random), anywhere(random), angle(random)};
  }
  std::vector<PoseDescriptor> poses;
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<Pixel> points;
    std::vector<float> directions;
    for (const Bone& bone : skeletons[random() % kinds]) {
      const double x = bone.x + 6 * wobble(random), y = bone.y + 6 * wobble(random);
      const double turned = std::fmod(bone.angle + 0.3 * wobble(random) + std::numbers::pi, std::numbers::pi);
      for (int step = 0; step < 25; ++step) {
        points.push_back({static_cast<std::int32_t>(std::lround(x + step * std::cos(turned))),
                          static_cast<std::int32_t>(std::lround(y - step * std::sin(turned)))});
        directions.push_back(static_cast<float>(turned));
      }
    }
    poses.push_back(describe_pose(points, directions).value());
  }
  return poses;
}

double weight_of(std::span<const PoseEdge> tree) {
  double sum = 0;
  for (const PoseEdge& edge : tree) sum += edge.weight;
  return sum;
}

// Prim's algorithm on the matrix of all weights.
double weight_by_hand(std::span<const PoseDescriptor> poses) {
  std::vector<double> nearest(poses.size(), 1e9);
  std::vector<bool> in(poses.size());
  double sum = 0;
  std::size_t newest = 0;
  in[0] = true;
  for (std::size_t k = 1; k < poses.size(); ++k) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      nearest[i] = std::min(nearest[i], 1 - correlation(poses[i], poses[newest]));
    }
    newest = poses.size();
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (!in[i] && (newest == poses.size() || nearest[i] < nearest[newest])) newest = i;
    }
    in[newest] = true;
    sum += nearest[newest];
  }
  return sum;
}

// Weights of the paths from one vertex to all others; greatest edges on them.
struct Paths {
  std::vector<double> length, greatest;
};
Paths paths_from(std::size_t start, std::size_t count, std::span<const PoseEdge> tree) {
  std::vector<std::vector<std::pair<std::size_t, double>>> next(count);
  for (const PoseEdge& edge : tree) {
    next[edge.a].emplace_back(edge.b, edge.weight);
    next[edge.b].emplace_back(edge.a, edge.weight);
  }
  Paths paths{std::vector<double>(count, -1), std::vector<double>(count, 0)};
  std::vector<std::size_t> queue = {start};
  paths.length[start] = 0;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    for (const auto& [v, weight] : next[queue[i]]) {
      if (paths.length[v] >= 0) continue;
      paths.length[v] = paths.length[queue[i]] + weight;
      paths.greatest[v] = std::max(paths.greatest[queue[i]], weight);
      queue.push_back(v);
    }
  }
  return paths;
}

// Mean distance of neighbours on the grid, relative to that in a random order.
double relative_distance(std::span<const PoseDescriptor> poses, std::vector<std::size_t> order, std::uint32_t levels) {
  const auto mean = [&] {
    double sum = 0, count = 0;
    for (std::uint32_t i = 0; i < order.size(); ++i) {
      const Pixel p = hilbert_pixel(levels, i);
      for (const Pixel& q : {Pixel{p.x + 1, p.y}, Pixel{p.x, p.y + 1}}) {
        if (std::max(q.x, q.y) >= std::int32_t{1} << levels) continue;
        sum += 1 - correlation(poses[order[i]], poses[order[hilbert_index(levels, q)]]);
        ++count;
      }
    }
    return sum / count;
  };
  const double ordered = mean();
  Random random(3);
  std::ranges::shuffle(order, random);
  return ordered / mean();
}

std::size_t count_of(std::string_view what, std::string_view text) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

TEST(SpanningTree, WeighsWhatPrimsDoes) {
  Random random(9);
  for (const std::size_t count : {2U, 3U, 20U, 250U}) {
    std::vector<PoseDescriptor> poses = poses_of_kinds(count, 5, random);
    if (count == 20)
      poses[3] = poses[7] = poses[1], poses[5] = PoseDescriptor{};  // equal ones, and one without a stroke
    const std::vector<PoseEdge> tree = spanning_tree(poses);
    ASSERT_EQ(tree.size(), count - 1);
    EXPECT_NEAR(weight_of(tree), weight_by_hand(poses), 1e-9);
    for (const PoseEdge& edge : tree) {
      EXPECT_LT(edge.a, edge.b);
      EXPECT_NEAR(edge.weight, 1 - correlation(poses[edge.a], poses[edge.b]), 1e-12);
    }
    EXPECT_TRUE(std::ranges::is_sorted(tree, {}, &PoseEdge::weight));
    const std::vector<double> length = paths_from(0, count, tree).length;
    EXPECT_TRUE(std::ranges::all_of(length, [](double l) { return l >= 0; }));  // connected
  }
  EXPECT_TRUE(spanning_tree({}).empty());
  EXPECT_TRUE(spanning_tree(poses_of_kinds(1, 1, random)).empty());
}

TEST(SpanningTree, LongestPathIsTheLongestOfAllPairs) {
  Random random(4);
  for (const std::size_t count : {1U, 2U, 7U, 40U}) {
    const std::vector<PoseEdge> tree = spanning_tree(poses_of_kinds(count, 4, random));
    double longest = 0;
    for (std::size_t v = 0; v < count; ++v) {
      longest = std::max(longest, std::ranges::max(paths_from(v, count, tree).length));
    }
    const std::vector<std::size_t> path = longest_path(count, tree);
    EXPECT_NEAR(paths_from(path.front(), count, tree).length[path.back()], longest, 1e-12);
    for (std::size_t i = 1; i < path.size(); ++i) {
      const auto [a, b] = std::minmax(path[i - 1], path[i]);
      EXPECT_EQ(
          std::ranges::count_if(tree, [low = a, high = b](const PoseEdge& e) { return e.a == low && e.b == high; }), 1);
    }
    EXPECT_EQ(preorder(count, tree).front(), path.front());
  }
  EXPECT_TRUE(longest_path(0, {}).empty());
  EXPECT_TRUE(preorder(0, {}).empty());
}

TEST(PosePicture, PutsPosesThatAreAlikeSideBySide) {
  Random random(10);
  const std::vector<PoseDescriptor> poses = poses_of_kinds(256, 6, random);
  const std::vector<std::size_t> order = preorder(poses.size(), spanning_tree(poses));
  ASSERT_EQ(std::set<std::size_t>(order.begin(), order.end()).size(), 256U);
  EXPECT_LE(relative_distance(poses, order, 4), 0.6);
  const std::string svg = pose_picture(poses, order);
  EXPECT_TRUE(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
  EXPECT_EQ(count_of("<path", svg), 256U);
}

// The paper's larger picture. No edge that is not in the tree is less than any on the tree's path between its ends:
// then a spanning tree is a least one.
TEST(PosePicture, TakesFourThousandPoses) {
  Random random(11);
  const std::vector<PoseDescriptor> poses = poses_of_kinds(4096, 40, random);
  const std::vector<PoseEdge> tree = spanning_tree(poses);
  ASSERT_EQ(tree.size(), 4095U);
  for (std::size_t start = 0; start < 4096; start += 512) {
    const Paths paths = paths_from(start, poses.size(), tree);
    for (std::size_t v = 0; v < poses.size(); ++v) {
      ASSERT_GE(paths.length[v], 0);
      EXPECT_TRUE(v == start || 1 - correlation(poses[start], poses[v]) > paths.greatest[v] - 1e-12);
    }
  }
  const std::vector<std::size_t> order = preorder(poses.size(), tree);
  ASSERT_EQ(std::set<std::size_t>(order.begin(), order.end()).size(), 4096U);
  EXPECT_LE(relative_distance(poses, order, 6), 0.6);
  const std::string svg = pose_picture(poses, order);
  EXPECT_EQ(count_of("<path", svg), 4096U);
  EXPECT_EQ(count_of("width=\"2560\" height=\"2560\"", svg), 1U);  // 64 tiles of 40
}

struct Line {
  int x1 = 0, y1 = 0, x2 = 0, y2 = 0;
};
bool share_an_end(const Line& a, const Line& b) {
  const std::set<std::pair<int, int>> ends = {{a.x1, a.y1}, {a.x2, a.y2}, {b.x1, b.y1}, {b.x2, b.y2}};
  return ends.size() < 4;
}
bool cross(const Line& a, const Line& b) {
  const auto side = [](const Line& l, int x, int y) {
    const int s = (l.x2 - l.x1) * (y - l.y1) - (l.y2 - l.y1) * (x - l.x1);
    return s > 0 ? 1 : s < 0 ? -1 : 0;
  };
  return side(a, b.x1, b.y1) * side(a, b.x2, b.y2) < 0 && side(b, a.x1, a.y1) * side(b, a.x2, a.y2) < 0;
}

TEST(TreePicture, HasItsLongestPathAsALineAndNothingCrossesOrOverlaps) {
  Random random(12);
  for (const std::size_t count : {1U, 2U, 9U, 120U}) {
    const std::vector<PoseDescriptor> poses = poses_of_kinds(count, 7, random);
    const std::vector<PoseEdge> tree = spanning_tree(poses);
    const std::string svg = tree_picture(poses, tree);
    std::set<std::pair<int, int>> tiles;
    const std::regex place(R"(translate\((\d+),(\d+)\))"), branch(R"(M(\d+) (\d+)L(\d+) (\d+))");
    for (std::sregex_iterator i(svg.begin(), svg.end(), place), end; i != end; ++i) {
      tiles.emplace(std::stoi((*i)[1]) / 40, std::stoi((*i)[2]) / 20);
      EXPECT_EQ(std::stoi((*i)[1]) % 40, 2);
      EXPECT_EQ(std::stoi((*i)[2]) % 60, 2);
    }
    EXPECT_EQ(tiles.size(), count);
    const std::size_t longest_at = svg.find("<path class=\"longest\""), tiles_at = svg.find("<path transform");
    std::vector<Line> lines;
    const std::string branches = svg.substr(0, longest_at), path = svg.substr(longest_at, tiles_at - longest_at);
    for (std::sregex_iterator i(branches.begin(), branches.end(), branch), end; i != end; ++i) {
      lines.push_back({std::stoi((*i)[1]), std::stoi((*i)[2]), std::stoi((*i)[3]), std::stoi((*i)[4])});
    }
    const std::size_t knots = longest_path(count, tree).size();
    EXPECT_EQ(lines.size() + knots, count);
    const std::regex knot(R"([ML](\d+) (\d+))");
    std::vector<std::pair<int, int>> walked;
    for (std::sregex_iterator i(path.begin(), path.end(), knot), end; i != end; ++i) {
      walked.emplace_back(std::stoi((*i)[1]), std::stoi((*i)[2]));
    }
    ASSERT_EQ(walked.size(), knots);
    for (std::size_t i = 1; i < knots; ++i) {
      EXPECT_GT(walked[i].first, walked[i - 1].first);
      EXPECT_EQ(walked[i].second, walked[0].second);
      lines.push_back({walked[i - 1].first, walked[i - 1].second, walked[i].first, walked[i].second});
    }
    for (std::size_t a = 0; a < lines.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) EXPECT_FALSE(!share_an_end(lines[a], lines[b]) && cross(lines[a], lines[b]));
    }
  }
  EXPECT_EQ(count_of("<path transform", tree_picture({}, {})), 0U);
}

// A stroke each in the upper left corner: flat, rising, upright; and all of them.
TEST(TreePicture, IsThisForFourPoses) {
  std::vector<PoseDescriptor> poses(4);
  poses[0][0] = poses[1][1] = poses[2][2] = 1;
  poses[3][0] = 1.0F, poses[3][1] = 0.9F, poses[3][2] = 0.8F;
  const std::vector<PoseEdge> tree = spanning_tree(poses);
  ASSERT_EQ(longest_path(4, tree), (std::vector<std::size_t>{1, 3, 2}));  // 0 is most like 3
  EXPECT_EQ(tree_picture(poses, tree), R"svg(<svg xmlns="http://www.w3.org/2000/svg" width="120" height="100">
<path class="branches" fill="none" stroke="silver" d="M60 80L60 20"/>
<path class="longest" fill="none" stroke="tomato" stroke-width="3" d="M20 80L60 80L100 80"/>
<path transform="translate(42,2)" stroke="black" d="M0.0 2.0L4.0 2.0"/>
<path transform="translate(2,62)" stroke="black" d="M0.6 3.4L3.4 0.6"/>
<path transform="translate(82,62)" stroke="black" d="M2.0 4.0L2.0 0.0"/>
<path transform="translate(42,62)" stroke="black" d="M0.0 2.0L4.0 2.0M0.6 3.4L3.4 0.6M2.0 4.0L2.0 0.0"/>
</svg>
)svg");
  EXPECT_EQ(pose_picture(poses, preorder(4, tree)),
            R"svg(<svg xmlns="http://www.w3.org/2000/svg" width="80" height="80">
<path transform="translate(2,2)" stroke="black" d="M0.6 3.4L3.4 0.6"/>
<path transform="translate(2,42)" stroke="black" d="M0.0 2.0L4.0 2.0M0.6 3.4L3.4 0.6M2.0 4.0L2.0 0.0"/>
<path transform="translate(42,42)" stroke="black" d="M0.0 2.0L4.0 2.0"/>
<path transform="translate(42,2)" stroke="black" d="M2.0 4.0L2.0 0.0"/>
</svg>
)svg");
}

}  // namespace
}  // namespace sherlog::rgbd

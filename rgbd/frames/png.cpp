#include "rgbd/frames/png.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <vector>

namespace sherlog::rgbd {
namespace {

constexpr std::array<std::uint32_t, 256> kCrcTable = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1U) != 0 ? 0xEDB88320U : 0U);
    table[i] = value;
  }
  return table;
}();

std::uint32_t big_endian(const std::uint8_t* p) {
  return std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | std::uint32_t{p[3]};
}

struct Header {
  std::uint32_t width = 0, height = 0;
  int bits = 0, colour_type = 0;
};

// Walks over the chunks. Empty, or what is wrong.
std::string check_chunks(std::span<const std::uint8_t> bytes, Header& header) {
  static constexpr std::uint8_t kSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  if (bytes.size() < 8 || std::memcmp(bytes.data(), kSignature, 8) != 0) return "this is not a PNG file";
  std::size_t at = 8;
  for (bool first = true;; first = false) {
    if (bytes.size() - at < 12) return fmt::format("the PNG file is cut off after {} bytes", bytes.size());
    const std::size_t length = big_endian(&bytes[at]);
    if (length > bytes.size() - at - 12) return fmt::format("the PNG file is cut off after {} bytes", bytes.size());
    const std::span<const std::uint8_t> typed = bytes.subspan(at + 4, length + 4);
    if (crc32(typed) != big_endian(&bytes[at + 8 + length])) {
      return fmt::format("the PNG file is damaged: wrong check sum at byte {}", at);
    }
    if (first) {
      if (std::memcmp(typed.data(), "IHDR", 4) != 0 || length < 13) return "the PNG file has no header";
      header = {big_endian(&typed[4]), big_endian(&typed[8]), typed[12], typed[13]};
      if (header.width < 1 || header.height < 1 || header.width > 16384 || header.height > 16384) {
        return fmt::format("an image of {} x {} pixels; each side has to be in 1 ... 16384", header.width,
                           header.height);
      }
    }
    if (std::memcmp(typed.data(), "IEND", 4) == 0) return {};
    at += 12 + length;
  }
}

}  // namespace

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t value = 0xFFFFFFFFU;
  for (const std::uint8_t byte : bytes) value = kCrcTable[(value ^ byte) & 0xFFU] ^ (value >> 8);
  return value ^ 0xFFFFFFFFU;
}

cv::Mat read_png(const std::filesystem::path& file, int type, std::string& problem) {
  const auto fail = [&](const std::string& what) {
    problem = file.string() + ": " + what;
    return cv::Mat();
  };
  std::ifstream in(file, std::ios::binary);
  if (!in || !std::filesystem::is_regular_file(file)) return fail("the file cannot be opened");
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  Header header;
  if (const std::string wrong = check_chunks(bytes, header); !wrong.empty()) return fail(wrong);
  const bool depth = type == CV_16UC1;
  if (depth && (header.bits != 16 || header.colour_type != 0)) {
    return fail(fmt::format("a depth image has 16 bits and one channel, this one {} bits{}", header.bits,
                            header.colour_type == 0 ? "" : " and colours"));
  }
  if (!depth && header.bits == 16) return fail("a colour image has 8 bits a channel, this one has 16");
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, depth ? cv::IMREAD_UNCHANGED : cv::IMREAD_COLOR);
  } catch (const cv::Exception&) {  // as an image that is empty
  }
  if (image.empty() || image.type() != type) return fail("the PNG file cannot be decoded");
  return image;
}

bool write_png(const std::filesystem::path& file, const cv::Mat& image, std::string& problem) {
  std::vector<std::uint8_t> bytes;
  bool encoded = false;
  try {
    encoded = cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
  } catch (const cv::Exception&) {
  }
  if (encoded) {
    std::ofstream out(file, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    out.flush();
    if (out) return true;
  }
  problem = file.string() + ": " + (encoded ? "the file cannot be written" : "the image cannot be encoded as PNG");
  return false;
}

}  // namespace sherlog::rgbd

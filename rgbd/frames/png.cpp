#include "rgbd/frames/png.h"

#include <fmt/format.h>
#include <png.h>

#include <array>
#include <csetjmp>
#include <cstring>
#include <fstream>
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

// libpng itself, not OpenCV's imgcodecs: that brings a hundred libraries with it, which every start of the program would
// have to load. libpng reports errors by longjmp, so what it may jump over has no destructors.

struct Source {
  const std::uint8_t* at;
  std::size_t left;
};

void take_bytes(png_structp png, png_bytep out, png_size_t count) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  if (count > source->left) png_error(png, "cut off");
  std::memcpy(out, source->at, count);
  source->at += count;
  source->left -= count;
}

void append_bytes(png_structp png, png_bytep bytes, png_size_t count) {
  auto* out = static_cast<std::vector<std::uint8_t>*>(png_get_io_ptr(png));
  out->insert(out->end(), bytes, bytes + count);
}

void flush_nothing(png_structp) {}
[[noreturn]] void jump_back(png_structp png, png_const_charp) { png_longjmp(png, 1); }
void keep_quiet(png_structp, png_const_charp) {}

// Into rows of `row_bytes` each: 16 bits in the machine's order, or blue, green, red.
bool decode(Source source, bool depth, std::size_t row_bytes, png_bytepp rows) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, jump_back, keep_quiet);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_set_read_fn(png, &source, take_bytes);
  png_read_info(png, info);
  if (depth) {
    png_set_swap(png);
  } else {
    png_set_expand(png);
    png_set_strip_alpha(png);
    png_set_gray_to_rgb(png);
    png_set_bgr(png);
  }
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != row_bytes) png_error(png, "another kind of image");
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

struct Shape {
  std::uint32_t width, height;
  int bits, colour_type;
};

bool encode(Shape shape, png_bytepp rows, std::vector<std::uint8_t>* out) {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, jump_back, keep_quiet);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_set_write_fn(png, out, append_bytes, flush_nothing);
  png_set_IHDR(png, info, shape.width, shape.height, shape.bits, shape.colour_type, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, 1);
  png_write_info(png, info);
  if (shape.bits == 16) png_set_swap(png);
  if (shape.colour_type == PNG_COLOR_TYPE_RGB) png_set_bgr(png);
  png_write_image(png, rows);
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return true;
}

std::vector<png_bytep> rows_of(const cv::Mat& image) {
  std::vector<png_bytep> rows;
  for (int y = 0; y < image.rows; ++y) rows.push_back(const_cast<png_bytep>(image.ptr(y)));
  return rows;
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
  std::error_code error;
  std::ifstream in;
  // A pipe would be waited for.
  if (std::filesystem::is_regular_file(file, error)) in.open(file, std::ios::binary);
  if (!in.is_open()) return fail("the file cannot be opened");
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  Header header;
  if (const std::string wrong = check_chunks(bytes, header); !wrong.empty()) return fail(wrong);
  const bool depth = type == CV_16UC1;
  if (depth && (header.bits != 16 || header.colour_type != 0)) {
    return fail(fmt::format("a depth image has 16 bits and one channel, this one {} bits{}", header.bits,
                            header.colour_type == 0 ? "" : " and colours"));
  }
  if (!depth && header.bits == 16) return fail("a colour image has 8 bits a channel, this one has 16");
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width), depth ? CV_16UC1 : CV_8UC3);
  std::vector<png_bytep> rows = rows_of(image);
  const std::size_t row_bytes = image.elemSize() * static_cast<std::size_t>(image.cols);
  if (image.type() != type || !decode({bytes.data(), bytes.size()}, depth, row_bytes, rows.data())) {
    return fail("the PNG file cannot be decoded");
  }
  return image;
}

bool write_png(const std::filesystem::path& file, const cv::Mat& image, std::string& problem) {
  std::vector<std::uint8_t> bytes;
  const bool known = image.type() == CV_16UC1 || image.type() == CV_8UC1 || image.type() == CV_8UC3;
  const Shape shape{static_cast<std::uint32_t>(image.cols), static_cast<std::uint32_t>(image.rows),
                    image.depth() == CV_16U ? 16 : 8, image.channels() == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY};
  std::vector<png_bytep> rows = rows_of(image);
  const bool encoded = known && !image.empty() && encode(shape, rows.data(), &bytes);
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

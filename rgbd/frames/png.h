// PNG files to images, with what is wrong as a sentence.
//
// Idea      The decoder behind OpenCV writes to the program's error stream and may hand over half an image. So the file
//           is checked first: signature, the chain of chunks with their check sums, bits and channels, the end. Only a
//           file that is whole goes to the decoder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace sherlog::rgbd {

// CRC-32 as in PNG and zip (polynomial 0xEDB88320, reflected).
std::uint32_t crc32(std::span<const std::uint8_t> bytes);

// Empty, and `problem` is "file: sentence", where the file is not a whole PNG of CV_16UC1 or CV_8UC3 (palettes and
// 8-bit grey come as CV_8UC3) as asked.
cv::Mat read_png(const std::filesystem::path& file, int type, std::string& problem);
bool write_png(const std::filesystem::path& file, const cv::Mat& image, std::string& problem);

}  // namespace sherlog::rgbd

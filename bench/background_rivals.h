// What our foreground is compared with: OpenCV's MOG2, GMG and the pyramid alone.
#pragma once

#include <opencv2/video/background_segm.hpp>
#include <string>
#include <vector>

#include "bench/gmg.h"
#include "rgbd/depth/background.h"

namespace sherlog::rgbd {

// Masks by other background models, each with the vote of nine, which helps them.
class Rivals {
 public:
  static std::vector<std::string> names() {
    return {"MOG2, colour", "MOG2, 8 bits",   "MOG2, disparity", "MOG2, inpainted",
            "GMG, colour",  "GMG, disparity", "GMG, sel. disp.", "GMG, sel. inpainted"};
  }
  Rivals() {
    for (int i = 0; i < 4; ++i) mixtures_.push_back(cv::createBackgroundSubtractorMOG2(500, 16, false));
    for (const bool is_selective : {false, false, true, true})
      histograms_.emplace_back(GmgOptions{.is_selective = is_selective});
  }

  // In the order of the names. `inpainted` is our disparity without gaps.
  const std::vector<MaskImage>& next(const Frame& frame, const DisparityImage& inpainted) {
    DisparityImage disparity, without_gaps;
    to_disparity(frame.depth, disparity);
    cv::max(disparity, 0.0, without_gaps);
    cv::Mat eight_bits;
    frame.depth.convertTo(eight_bits, CV_8U, 255.0 / 10000);
    const cv::Mat images[] = {frame.colour, eight_bits, without_gaps, inpainted};
    cv::Mat1i features[4];
    colour_features(frame.colour, features[0]);
    disparity_features(disparity, 4, features[1]);
    features[2] = features[1];
    disparity_features(inpainted, 4, features[3]);
    masks_.resize(8);
    MaskImage mask;
    for (std::size_t i = 0; i < 8; ++i) {
      if (i < 4) {
        mixtures_[i]->apply(images[i], mask);
      } else {
        histograms_[i - 4].next(features[i - 4], mask);
      }
      vote_of_nine(mask, frame.depth, masks_[i]);
    }
    return masks_;
  }

 private:
  std::vector<cv::Ptr<cv::BackgroundSubtractorMOG2>> mixtures_;
  std::vector<Gmg> histograms_;
  std::vector<MaskImage> masks_;
};

// Foreground from the pyramid alone (Alg. 2) in front of the same background.
inline MaskImage outline_by_pyramid(const DepthPreprocessing& ours) {
  DisparityImage alone;
  to_disparity(ours.inpainted(), alone);
  MaskImage nearer, outline;
  cv::compare(ours.background().disparity() - alone, 4.0, nearer, cv::CMP_GT);
  vote_of_nine(nearer, {}, outline);
  return outline;
}

}  // namespace sherlog::rgbd

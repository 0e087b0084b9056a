#include "clip.hpp"

#include <algorithm>
#include <cerrno>
#include <fstream>

namespace rtpm::media {
namespace {

constexpr char kDark = 40;
constexpr char kBright = static_cast<char>(220);
constexpr char kGrey = static_cast<char>(128);  ///< The value that means grey in a colour plane.

void draw(std::string& luma, const ClipConfig& config, int frame) {
  std::fill(luma.begin(), luma.end(), kDark);
  const int frame_count = config.duration_s * config.frames_per_s;
  const int bar = frame * config.width / frame_count;
  const bool is_lit = frame / config.frames_per_s % 2 == 0;
  for (int y = 0; y < config.height; ++y) {
    const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(config.width);
    luma[row + static_cast<std::size_t>(bar)] = kBright;
    if (is_lit && y < config.height / 8)
      std::fill_n(luma.begin() + static_cast<long>(row), 8, kBright);
  }
}

}  // namespace

expected<void, SetupError> write_clip(const std::string& path, const ClipConfig& config) {
  std::ofstream file(path, std::ios::binary);
  file << "YUV4MPEG2 W" << config.width << " H" << config.height << " F" << config.frames_per_s
       << ":1 Ip A1:1 C420jpeg\n";
  std::string luma(static_cast<std::size_t>(config.width * config.height), kDark);
  const std::string chroma(luma.size() / 2, kGrey);
  for (int frame = 0; file && frame < config.duration_s * config.frames_per_s; ++frame) {
    draw(luma, config, frame);
    file << "FRAME\n" << luma << chroma;
  }
  file.close();
  if (!file) {
    return setup_error("the clip " + path + " can't be written", system_error(errno),
                       "name a folder that this program may write to");
  }
  return {};
}

}  // namespace rtpm::media

#include "line.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace rtpm::media {
namespace {

constexpr int kBarWidth = 24;

std::string bar_text(const PlayerView& player) {
  const double share =
      player.duration_s > 0 ? std::clamp(player.position_s / player.duration_s, 0.0, 1.0) : 0;
  const auto at = static_cast<std::size_t>(std::lround(share * (kBarWidth - 1)));
  std::string bar(kBarWidth, '.');
  std::fill_n(bar.begin(), at, '=');
  bar[at] = '|';
  return bar;
}

std::string rate_text(double rate) {
  if (rate == 0) return "paused";
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%+.2f x", rate);
  return text.data();
}

}  // namespace

std::string line_text(Mode mode, const PlayerView& player, double angle_rad) {
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(), "%-5s [%s] %7.2f of %.2f s  %7s  dial %+7.1f°",
                std::string(to_string(mode)).c_str(), bar_text(player).c_str(), player.position_s,
                player.duration_s, rate_text(player.rate).c_str(),
                angle_rad * 180 / std::numbers::pi);
  return text.data();
}

std::string follow_text(const FollowMeter& meter) {
  const auto milliseconds = [&](double percent) {
    return std::chrono::duration<double, std::milli>(meter.followed().percentile(percent)).count();
  };
  std::array<char, 192> text{};
  std::snprintf(text.data(), text.size(),
                "followed %llu of %llu targets, %.2f s forwards and %.2f s backwards; shown after "
                "%.1f ms (median), %.1f ms (99 %%)",
                static_cast<unsigned long long>(meter.followed().count()),
                static_cast<unsigned long long>(meter.target_count()), meter.forwards_s(),
                meter.backwards_s(), milliseconds(50), milliseconds(99));
  return text.data();
}

}  // namespace rtpm::media

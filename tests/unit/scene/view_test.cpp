#include "view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace rtpm::scene {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin{std::chrono::seconds{1000}};

driver::Sample sample_at(double z_m) {
  driver::Sample sample;
  sample.pose.position_m = {0.0123, 0, z_m};
  return sample;
}

TouchReport touch_at(double proxy_z_m) {
  return {.scene = {Shape::kPlane, 0},
          .touch = {.device_m = {0.0123, 0, -0.003},
                    .proxy_m = {0.0123, 0, proxy_z_m},
                    .force_newton = {0, 0, 1.8},
                    .depth_m = 0.003}};
}

TEST(Pace, CountsFromTheFirstToTheLast) {
  Pace pace;
  EXPECT_TRUE(pace.is_silent(kBegin));
  EXPECT_EQ(pace.rate_hz(), 0);
  for (int i = 0; i <= 60; ++i)
    pace.record(kBegin + milliseconds{10 * i});
  EXPECT_EQ(pace.count(), 61u);
  EXPECT_NEAR(pace.rate_hz(), 100, 1e-9);
  EXPECT_FALSE(pace.is_silent(kBegin + milliseconds{1100}));
  EXPECT_TRUE(pace.is_silent(kBegin + milliseconds{1101}));
}

TEST(View, CountsTheContactsWhoseProxyIsAtTheSurface) {
  View view;
  for (const double proxy_z_m : {1e-7, 2e-5, -1e-9}) {
    view.see(touch_at(proxy_z_m), kBegin);
  }
  TouchReport free = touch_at(0.01);
  free.touch.depth_m = 0;
  view.see(free, kBegin);
  const Sight sight = view.sight();
  EXPECT_EQ(sight.touches.count(), 4u);
  EXPECT_EQ(sight.contact_count, 3u);
  EXPECT_EQ(sight.on_surface_count, 1u) << "one flies above it, one is inside";
  EXPECT_EQ(sight.depth_m_max, 0.003);
  EXPECT_EQ(sight.force_newton_max, 1.8);
}

TEST(View, KeepsTheNewestOfItsHistory) {
  View view;
  for (std::size_t i = 0; i < View::kHistoryMax + 10; ++i)
    view.see(sample_at(1e-3 * static_cast<double>(i)), kBegin);
  const auto all = view.history(2 * View::kHistoryMax).device_m;
  ASSERT_EQ(all.size(), View::kHistoryMax);
  EXPECT_DOUBLE_EQ(all.front().z, 0.010);
  const auto newest = view.history(3).device_m;
  ASSERT_EQ(newest.size(), 3u);
  EXPECT_DOUBLE_EQ(newest.back().z, 1e-3 * static_cast<double>(View::kHistoryMax + 9));
  EXPECT_TRUE(view.history(3).touches.empty());
}

TEST(View, SkipsNonFinitePositions) {
  View view;
  for (const double z_m : {0.001, std::nan(""), HUGE_VAL, 1e300})
    view.see(sample_at(z_m), kBegin);
  EXPECT_EQ(view.history(10).device_m.size(), 1u);
  EXPECT_EQ(view.sight().samples.count(), 4u) << "they came all the same";
}

TEST(StatusText, NamesTheNodeThatIsSilent) {
  View view;
  const auto status = [&](Duration later) {
    return status_text(view.sight(), kBegin + later, later);
  };
  EXPECT_NE(status(milliseconds{0}).find("device is silent"), std::string::npos);
  view.see(sample_at(-0.003), kBegin);
  EXPECT_NE(status(milliseconds{0}).find("force is silent"), std::string::npos);
  view.see(touch_at(0), kBegin);
  EXPECT_EQ(status(milliseconds{200}),
            "  0.2 s  at  +12.3   +0.0   -3.0 mm  depth  3.0 mm  force  1.80 N  touching");
  EXPECT_NE(status(milliseconds{600}).find("device is silent"), std::string::npos);
}

TEST(SummaryText, HasTheRatesAndTheGreatestForce) {
  View view;
  for (int i = 0; i <= 20; ++i) {
    view.see(sample_at(0), kBegin + milliseconds{20 * i});
    view.see(touch_at(1e-7), kBegin + milliseconds{25 * i});
  }
  EXPECT_EQ(summary_text(view.sight(), 24, milliseconds{400}),
            "24 frames in 0.4 s of 50.0 samples/s and 40.0 touches/s; proxy on the surface in 21 "
            "of 21 contacts, greatest depth 3.0 mm, greatest force 1.80 N");
  EXPECT_EQ(caption_text(view.sight(), "lab/arm0"),
            "lab/arm0 at the plane: greatest depth 3.0 mm, greatest force 1.80 N");
  EXPECT_EQ(caption_text({}, "lab/arm0"), "lab/arm0: the force node is silent");
}

}  // namespace
}  // namespace rtpm::scene

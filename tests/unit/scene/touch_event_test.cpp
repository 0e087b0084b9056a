#include "touch_event.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace rtpm::scene {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TouchReport report() {
  return {.cycle = 42,
          .scene = {Shape::kTexture, 0.001},
          .touch = {.device_m = {1, 2, 3}, .proxy_m = {1, 2, 5}, .force_newton = {4, 5, 6}}};
}

TEST(TouchEvent, ArrivesAsItWasSent) {
  const auto read = from_wire(to_wire(report()));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->cycle, 42u);
  EXPECT_EQ(read->scene, report().scene);
  EXPECT_EQ(read->touch.device_m, report().touch.device_m);
  EXPECT_EQ(read->touch.proxy_m, report().touch.proxy_m);
  EXPECT_EQ(read->touch.force_newton, report().touch.force_newton);
  EXPECT_EQ(read->touch.depth_m, 2) << "from device to proxy";
}

TEST(TouchEvent, OfImplausibleNumbersIsNotRead) {
  for (const double number : {kNan, kInfinity, -kInfinity, 1e300}) {
    TouchReport bad = report();
    bad.touch.device_m.x = number;
    EXPECT_FALSE(from_wire(to_wire(bad)));
    bad = report();
    bad.touch.proxy_m.y = number;
    EXPECT_FALSE(from_wire(to_wire(bad)));
    bad = report();
    bad.touch.force_newton.z = number;
    EXPECT_FALSE(from_wire(to_wire(bad)));
    bad = report();
    bad.scene.face_m = number;
    EXPECT_FALSE(from_wire(to_wire(bad)));
  }
}

TEST(TouchEvent, OfALaterVersionsShapeIsNotRead) {
  TouchReport later = report();
  later.scene.shape = Shape{kShapeCount};
  EXPECT_FALSE(from_wire(to_wire(later)));
}

TEST(TouchEvent, HasASourceForEachDevice) {
  EXPECT_NE(touch_source_of("lab/arm0"), touch_source_of("lab/arm1"));
}

}  // namespace
}  // namespace rtpm::scene

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

TEST(TouchEvent, IsRefusedWithImplausibleNumbers) {
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

TEST(TouchEvent, IsRefusedWithALaterVersionsShape) {
  TouchReport later = report();
  later.scene.shape = Shape{kShapeCount};
  EXPECT_FALSE(from_wire(to_wire(later)));
}

}  // namespace
}  // namespace rtpm::scene

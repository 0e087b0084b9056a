#include "touch_event.hpp"

#include <cmath>
#include <utility>

#include "rtpm/driver/vector.hpp"
#include "rtpm/gvd/device_event.hpp"

namespace rtpm::scene {
namespace {

/// Above any force that a force loop commands, and far from overflow in a drawing.
constexpr double kForceMaxNewton = 1e9;

touch::Vector3 wire_of(const driver::Vector3& vector) noexcept {
  return {vector.x, vector.y, vector.z};
}
driver::Vector3 vector_of(const touch::Vector3& wire) noexcept {
  return {wire.x(), wire.y(), wire.z()};
}

}  // namespace

touch::State to_wire(const TouchReport& report) noexcept {
  return {report.cycle,
          wire_of(report.touch.device_m),
          wire_of(report.touch.proxy_m),
          wire_of(report.touch.force_newton),
          report.scene.face_m,
          static_cast<touch::Shape>(report.scene.shape)};
}

std::optional<TouchReport> from_wire(const touch::State& state) noexcept {
  const auto shape = static_cast<std::uint8_t>(state.shape());
  if (shape >= kShapeCount) return std::nullopt;
  TouchReport report{.cycle = state.cycle(),
                     .scene = {static_cast<Shape>(shape), state.face_m()},
                     .touch = {.device_m = vector_of(state.device_m()),
                               .proxy_m = vector_of(state.proxy_m()),
                               .force_newton = vector_of(state.force_newton())}};
  report.touch.depth_m = length(difference(report.touch.proxy_m, report.touch.device_m));
  const bool is_known = std::abs(report.scene.face_m) <= kExtentMetre &&
                        is_position(report.touch.device_m) && is_position(report.touch.proxy_m) &&
                        length(report.touch.force_newton) <= kForceMaxNewton;
  return is_known ? std::optional(report) : std::nullopt;
}

events::SourceId touch_source_of(std::string_view device) noexcept {
  return gvd::source_of(device);
}

expected<TouchSupplier, SetupError> TouchSupplier::create(rpc::Node& node, const std::string& hub,
                                                          std::string_view device) {
  auto supplier = Supplier::create(node, hub, touch_source_of(device), {.name = "touches"});
  if (!supplier) return unexpected{std::move(supplier.error())};
  return TouchSupplier(std::move(*supplier));
}

void TouchSupplier::add(const TouchReport& report) noexcept {
  static_cast<void>(supplier_.add(to_wire(report)));
}

void TouchSupplier::flush() noexcept {
  static_cast<void>(supplier_.flush());
}

}  // namespace rtpm::scene

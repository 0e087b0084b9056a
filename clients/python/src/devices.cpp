#include "devices.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <device.rtpm.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "binding.hpp"
#include "errors.hpp"
#include "remote_device.hpp"
#include "rtpm/gvd/models_wire.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/models/check.hpp"
#include "rtpm/rpc/tables.hpp"
#include "rtpm/rt/clock.hpp"
#include "servo.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

/// The names of gvd::DeviceOutcome's values in rtpm/errors.py.
const char* name_of(gvd::DeviceOutcome outcome) noexcept {
  switch (outcome) {
    case gvd::DeviceOutcome::kNotHolder:
      return "LeaseLost";
    case gvd::DeviceOutcome::kHeld:
      return "LeaseHeld";
    case gvd::DeviceOutcome::kNotActive:
      return "NotActive";
    case gvd::DeviceOutcome::kEmergencyStop:
      return "EmergencyStopped";
    case gvd::DeviceOutcome::kWrongMode:
    case gvd::DeviceOutcome::kNotFinite:
    case gvd::DeviceOutcome::kOutOfRange:
      return "BadCommand";
    default:
      return "DeviceError";
  }
}

[[noreturn]] void raise_device(const gvd::DeviceError& error, const std::string& target,
                               const std::string& text = {}) {
  if (error.outcome() == gvd::DeviceOutcome::kCallFailed) raise(error.call(), {}, target);
  const RunsPython scope;
  const std::string why = text.empty() ? std::string(gvd::to_string(error)) : text;
  raise_object(
      nb::module_::import_("rtpm.errors").attr("of_device")(name_of(error.outcome()), why, target));
}

void check(const gvd::DeviceResult& result, const std::string& target) {
  if (!result) raise_device(result.error(), target);
}

Duration seconds(double value) {
  return *span_of(value);
}

template <class T>
T from_bytes(const nb::bytes& bytes) {
  if (bytes.size() != sizeof(T)) raise_value_error("the struct has the wrong size");
  T value;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

/// Runs one of the client's methods of set-up on a thread of its own.
template <class Method>
void set_up(const SharedDevice& device, Method method) {
  device->see();
  check(interruptible<gvd::DeviceResult>([device, method] {
          const std::lock_guard lock(device->mutex());
          return method(device->client());
        }),
        device->target());
}

SharedDevice open(const SharedNode& node, std::string target, double hold, double patience,
                  double stall) {
  using Opened = expected<SharedDevice, SetupError>;
  return value_of(interruptible<Opened>([node, target = std::move(target), hold = seconds(hold),
                                         patience = seconds(patience), stall = seconds(stall)] {
    return RemoteDevice::open(node, target, hold, patience, stall);
  }));
}

nb::bytes read(RemoteDevice& self, std::optional<int> priority) {
  self.see();
  const rpc::CallOptions options = options_of(priority, std::nullopt);
  const auto sample = [&] {
    const Released released;
    return self.client().read(options);
  }();
  if (!sample) raise_device(sample.error(), self.target());
  const device::Sample wire = gvd::to_wire(*sample);
  return nb::bytes(&wire, sizeof wire);
}

void command(RemoteDevice& self, const driver::Setpoint& setpoint, std::optional<int> priority) {
  self.see();
  const rpc::CallOptions options = options_of(priority, std::nullopt);
  const auto done = [&] {
    const Released released;
    return self.client().set(setpoint, options);
  }();
  check(done, self.target());
}

void set_wrench(RemoteDevice& self, std::array<double, 6> wrench, std::optional<int> priority) {
  command(self,
          driver::Setpoint::with_wrench(
              {{wrench[0], wrench[1], wrench[2]}, {wrench[3], wrench[4], wrench[5]}}),
          priority);
}

void acquire(const SharedDevice& self, double patience) {
  set_up(self, [patience = seconds(patience)](gvd::DeviceClient& client) {
    return client.acquire(patience);
  });
  self->keep_lease();
}

void release(const SharedDevice& self) {
  {
    const Released released;
    self->stop_keeping();
  }
  set_up(self, [](gvd::DeviceClient& client) { return client.release(); });
}

/// The models of a finished SetModelsRequest.
gvd::ModelList models_of(const nb::bytes& request) {
  const auto* data = static_cast<const std::byte*>(request.data());
  const std::vector<std::byte> bytes(data, data + request.size());
  if (!rpc::is_valid_table<device::SetModelsRequest>(bytes)) {
    raise_value_error("the models are malformed");
  }
  auto models = gvd::from_wire(*flatbuffers::GetRoot<device::SetModelsRequest>(bytes.data()));
  if (!models) raise_value_error(models.error());
  return *std::move(models);
}

void set_models(const SharedDevice& self, const nb::bytes& request) {
  self->see();
  const auto models = models_of(request);
  using Set = expected<void, gvd::ModelsError>;
  const auto done = interruptible<Set>([self, models] {
    const std::lock_guard lock(self->mutex());
    return self->client().set_models(models.models());
  });
  if (!done) raise_device(done.error().error, self->target(), done.error().text);
}

void emergency_stop(const SharedDevice& self, int scope) {
  set_up(self, [scope = static_cast<gvd::StopScope>(scope)](gvd::DeviceClient& client) {
    return client.emergency_stop(scope);
  });
}

/// The models, which a loop of this period can render stably.
gvd::ModelList models_for(const SharedDevice& device, Duration period, const nb::bytes& request) {
  const gvd::ModelList models = models_of(request);
  const auto limits = gvd::ModelLimits::for_device(device->client().descriptor(), period);
  if (const auto checked = gvd::check(models, limits); !checked) {
    std::string text = gvd::to_text(checked.error());
    if (checked.error().field.starts_with("stiffness")) {
      text += " in a loop of " +
              std::to_string(std::lround(1e9 / static_cast<double>(period.count()))) +
              " Hz; tip.set_models() renders in the device's own";
    }
    raise_device(gvd::DeviceOutcome::kOutOfRange, device->target(), text);
  }
  return models;
}

std::unique_ptr<Servo> start_servo(const SharedDevice& device, double rate_hz, int priority,
                                   const nb::bytes& request) {
  if (!(rate_hz >= 1 && rate_hz <= 10'000)) raise_value_error("rate takes 1 to 10000 Hz");
  const Duration period{static_cast<Duration::rep>(1e9 / rate_hz)};
  const auto models = models_for(device, period, request);
  device->see();
  auto servo = value_of(Servo::start(device, period, *options_of(priority, std::nullopt).priority));
  servo->set(models);
  return servo;
}

nb::dict to_python(const LoopFigures& figures) {
  nb::dict result;
  result["cycles"] = figures.cycle_count;
  result["late"] = figures.late_count;
  result["failed"] = figures.failed_count;
  result["paused"] = figures.paused_count;
  result["worst_s"] = static_cast<double>(figures.worst.count()) * 1e-9;
  return result;
}

/// Paces a loop of Python.
class Pacer {
 public:
  explicit Pacer(double rate_hz) {
    if (!(rate_hz > 0 && rate_hz <= 100'000)) raise_value_error("rate takes up to 100000 Hz");
    period_ = Duration{static_cast<Duration::rep>(1e9 / rate_hz)};
  }

  /// Waits for the next period; skips those that have passed.
  void wait() {
    if (next_ == MonotonicTime{}) next_ = rt::now();
    next_ += period_;
    wait_in_slices([this] {
      const MonotonicTime slice = std::min(next_, rt::now() + kSlice);
      rt::sleep_until(slice);
      return slice == next_;
    });
    const Duration late = rt::now() - next_;
    ++figures_.cycle_count;
    figures_.worst = std::max(figures_.worst, late);
    if (late < period_) return;
    const auto skipped = late / period_;
    figures_.late_count += static_cast<std::uint64_t>(skipped);
    next_ += skipped * period_;
  }
  nb::dict figures() const { return to_python(figures_); }

 private:
  Duration period_{};
  MonotonicTime next_{};
  LoopFigures figures_{};
};

}  // namespace

void define_devices(nb::module_& module) {
  nb::class_<RemoteDevice>(module, "Device")
      .def(nb::new_(&open), "node"_a, "target"_a, "hold"_a, "patience"_a, "stall"_a)
      .def_prop_ro("target", &RemoteDevice::target)
      .def_prop_ro("url", [](RemoteDevice& self) { return self.client().url(); })
      .def_prop_ro("force_end_s",
                   [](RemoteDevice& self) {
                     return static_cast<double>(self.client().force_end().count()) * 1e-9;
                   })
      .def("see", &RemoteDevice::see)
      .def("read", &read, "priority"_a.none())
      .def("set_wrench", &set_wrench, "wrench"_a, "priority"_a.none())
      .def(
          "command",
          [](RemoteDevice& self, const nb::bytes& bytes, std::optional<int> priority) {
            command(self, gvd::from_wire(from_bytes<device::Command>(bytes)).setpoint, priority);
          },
          "command"_a, "priority"_a.none())
      .def("set_models", &set_models, "request"_a)
      .def("acquire", &acquire, "patience"_a)
      .def("take_over",
           [](const SharedDevice& self) {
             set_up(self, [](gvd::DeviceClient& client) { return client.take_over(); });
             self->keep_lease();
           })
      .def("release", &release)
      .def("recover",
           [](const SharedDevice& self) {
             set_up(self, [](gvd::DeviceClient& client) { return client.recover(); });
           })
      .def("activate",
           [](const SharedDevice& self) {
             set_up(self, [](gvd::DeviceClient& client) { return client.activate(); });
           })
      .def("deactivate",
           [](const SharedDevice& self) {
             set_up(self, [](gvd::DeviceClient& client) { return client.deactivate(); });
           })
      .def("emergency_stop", &emergency_stop, "scope"_a)
      .def("rearm", [](const SharedDevice& self) {
        set_up(self, [](gvd::DeviceClient& client) { return client.rearm(); });
      });
  nb::class_<Servo>(module, "Servo")
      .def(nb::new_(&start_servo), "device"_a, "rate_hz"_a, "priority"_a, "models"_a)
      .def(
          "set",
          [](Servo& self, const nb::bytes& models) {
            self.set(models_for(self.device(), self.period(), models));
          },
          "models"_a)
      .def("stop",
           [](Servo& self) {
             const Released released;
             self.stop();
           })
      .def_prop_ro("is_running", &Servo::is_running)
      .def("figures", [](const Servo& self) { return to_python(self.figures()); });
  nb::class_<Pacer>(module, "Pacer")
      .def(nb::init<double>(), "rate_hz"_a)
      .def("wait", &Pacer::wait)
      .def("figures", &Pacer::figures);
}

}  // namespace rtpm::python

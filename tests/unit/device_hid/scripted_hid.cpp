#include "scripted_hid.hpp"

#include <algorithm>
#include <thread>
#include <utility>

#include "hid_game_pad_model.hpp"
#include "hid_open_ff_board_model.hpp"
#include "hid_sony_pad_model.hpp"
#include "hid_space_mouse_model.hpp"

namespace rtpm::test {
namespace {

constexpr Duration kTick = std::chrono::milliseconds{1};

HidReport to_report(ConstBytes bytes) {
  HidReport report;
  for (const std::byte byte : bytes)
    report.push_back(std::to_integer<std::uint8_t>(byte));
  return report;
}

std::size_t copy(const HidReport& report, MutableBytes to) {
  const std::size_t size = std::min(report.size(), to.size());
  std::transform(report.begin(), report.begin() + static_cast<std::ptrdiff_t>(size), to.begin(),
                 [](std::uint8_t byte) { return static_cast<std::byte>(byte); });
  return size;
}

class ScriptedTransport final : public device_hid::HidTransport {
 public:
  explicit ScriptedTransport(std::shared_ptr<ScriptedHidPort> port) : port_(std::move(port)) {}
  [[nodiscard]] device_hid::Received read(MutableBytes buffer, Duration patience) override {
    // Simulated time is fast, and a wheel's driver reads at SCHED_FIFO: the other threads need the
    // CPU, too.
    if (++read_count_ % 32 == 0) std::this_thread::sleep_for(std::chrono::microseconds{20});
    return port_->read(buffer, patience);
  }
  [[nodiscard]] bool write(ConstBytes report) override { return port_->write(report); }
  [[nodiscard]] std::size_t read_feature(MutableBytes report) override {
    return port_->read_feature(report);
  }
  [[nodiscard]] MonotonicTime now() const override { return port_->now(); }

 private:
  std::shared_ptr<ScriptedHidPort> port_;
  std::uint64_t read_count_ = 0;
};

}  // namespace

void ScriptedHidPort::set_fault(HidFault fault, std::uint64_t from_step) {
  const std::lock_guard lock(mutex_);
  fault_ = fault;
  from_step_ = from_step;
}

std::uint64_t ScriptedHidPort::step_count() const {
  const std::lock_guard lock(mutex_);
  return step_count_;
}

MonotonicTime ScriptedHidPort::now() const {
  const std::lock_guard lock(mutex_);
  return now_;
}

void ScriptedHidPort::hold_writes() {
  write_mutex_.lock();
}
void ScriptedHidPort::release_writes() {
  write_mutex_.unlock();
}

/// Queues the faulty data that arrives instead of `report`.
void ScriptedHidPort::spoil(HidReport report) {
  const auto middle = static_cast<std::ptrdiff_t>(report.size() / 2);
  if (has(HidFault::kShort)) report.pop_back();
  if (has(HidFault::kLong)) report.push_back(7);
  if (has(HidFault::kFlipped)) report[report.size() / 2] ^= 0x10;
  if (has(HidFault::kGarbage)) report.assign(report.size(), 0xee);
  if (has(HidFault::kStale) && !last_.empty()) report = last_;
  if (has(HidFault::kGlued)) report.insert(report.end(), report.begin(), report.end());
  if (has(HidFault::kSplit)) {
    spoilt_.emplace_back(report.begin(), report.begin() + middle);
    report.erase(report.begin(), report.begin() + middle);
  }
  if (has(HidFault::kSilent)) return;
  last_ = report;
  spoilt_.push_back(std::move(report));
}

device_hid::Received ScriptedHidPort::read(MutableBytes buffer, Duration patience) {
  const std::lock_guard lock(mutex_);
  const MonotonicTime end = now_ + patience;
  while (true) {
    if (has(HidFault::kUnplugged)) return {0, true};
    if (!spoilt_.empty()) {
      const HidReport report = std::exchange(spoilt_.front(), {});
      spoilt_.pop_front();
      return {copy(report, buffer), false};
    }
    HidReport report;
    if (model_->take_input(report)) {
      ++step_count_;
      spoil(std::move(report));
      continue;
    }
    if (now_ >= end) return {};
    now_ += kTick;
    model_->advance(kTick);
    if (has(HidFault::kStuckButton)) model_->press(0, true);
  }
}

bool ScriptedHidPort::write(ConstBytes report) {
  const std::lock_guard write_lock(write_mutex_);
  const std::lock_guard lock(mutex_);
  ++step_count_;
  if (has(HidFault::kUnplugged) || has(HidFault::kRefuses)) return false;
  return model_->write(to_report(report));
}

std::size_t ScriptedHidPort::read_feature(MutableBytes report) {
  const std::lock_guard lock(mutex_);
  ++step_count_;
  if (has(HidFault::kUnplugged) || has(HidFault::kRefuses)) return 0;
  HidReport feature = model_->read_feature(std::to_integer<std::uint8_t>(report[0]));
  if (has(HidFault::kFlipsFeatures) && !feature.empty()) feature[feature.size() / 2] ^= 0x10;
  return copy(feature, report);
}

std::shared_ptr<ScriptedHidPort> ScriptedHidSystem::plug(std::shared_ptr<HidModel> model,
                                                         const std::string& serial,
                                                         const std::string& port,
                                                         const std::string& node) {
  const HidIdentity identity = model->identity();
  device_hid::Unit unit{
      .vendor = identity.vendor,
      .product = identity.product,
      .bus = identity.is_bluetooth ? device_hid::Bus::kBluetooth : device_hid::Bus::kUsb,
      .model = identity.name,
      .serial = serial,
      .port = port,
      .node = node};
  for (const std::uint8_t byte : model->report_descriptor())
    unit.report_descriptor.push_back(static_cast<std::byte>(byte));
  plugged.push_back({unit, std::make_shared<ScriptedHidPort>(std::move(model))});
  return plugged.back().port;
}

std::vector<device_hid::Unit> ScriptedHidSystem::units() {
  std::vector<device_hid::Unit> found;
  for (const Plugged& each : plugged)
    found.push_back(each.unit);
  return found;
}

expected<std::unique_ptr<device_hid::HidTransport>, SetupError> ScriptedHidSystem::open(
    const device_hid::Unit& unit) {
  for (const Plugged& each : plugged) {
    if (each.unit.node != unit.node) continue;
    if (each.is_forbidden) return setup_error(unit.node + " can't be opened", "no right", "a rule");
    return std::unique_ptr<device_hid::HidTransport>(
        std::make_unique<ScriptedTransport>(each.port));
  }
  return setup_error(unit.node + " is gone");
}

std::shared_ptr<ScriptedHidSystem> system_with(std::shared_ptr<HidModel> model) {
  auto system = std::make_shared<ScriptedHidSystem>();
  system->plug(std::move(model), "scripted-1", "usb-1/input0", "/dev/hidraw0");
  return system;
}

std::shared_ptr<HidModel> make_model(std::size_t kind, bool is_bluetooth) {
  switch (kind) {
    case 0:
      return std::make_shared<SpaceMouseModel>(SpaceMouseModel::Layout::kTwoReports);
    case 1:
      return std::make_shared<GamePadModel>();
    case 2:
      return std::make_shared<DualShock4Model>(is_bluetooth);
    case 3:
      return std::make_shared<DualSenseModel>(is_bluetooth);
    default:
      return std::make_shared<OpenFfBoardModel>();
  }
}

}  // namespace rtpm::test

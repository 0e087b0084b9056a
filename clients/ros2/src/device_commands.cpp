#include "device_commands.hpp"

#include <utility>

#include "rtpm/ros2/message.hpp"
#include "rtpm/ros2/names.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::ros2 {
namespace {

using namespace std::chrono_literals;

/// After this pause the lease is released.
constexpr Duration kPause = 1s;
constexpr Duration kCallDeadline = 50ms;
/// A message of any of the four types is far smaller.
constexpr std::uint32_t kCommandSizeMax = 16'384;
/// The newest command matters only. Best effort matches publishers of both kinds.
constexpr Quality kNewest{.reliability = Reliability::kBestEffort, .depth = 1};

Topic topic_of(const std::string& device, CommandKind kind) {
  std::string name = topic_name(device, subject_of(kind));
  const auto topic = [&]<class M>(const M&) {
    return Topic{std::move(name), std::string(M::kType), type_hash<M>()};
  };
  switch (kind) {
    case CommandKind::kWrench:
      return topic(WrenchStamped{});
    case CommandKind::kPose:
      return topic(PoseStamped{});
    case CommandKind::kTwist:
      return topic(TwistStamped{});
    case CommandKind::kJoints:
      break;
  }
  return topic(JointState{});
}

}  // namespace

expected<std::unique_ptr<DeviceCommands>, SetupError> DeviceCommands::create(
    rpc::Node& node, Participant& participant, const std::string& device,
    const CommandConfig& config) {
  auto client = gvd::DeviceClient::open(node, device, {.bind = {}, .hold = config.hold});
  if (!client) return unexpected{std::move(client.error())};
  std::unique_ptr<DeviceCommands> commands(new DeviceCommands(std::move(*client), config));
  if (auto opened = commands->open(participant, device); !opened)
    return unexpected{std::move(opened.error())};
  return commands;
}

expected<void, SetupError> DeviceCommands::open(Participant& participant,
                                                const std::string& device) {
  const std::vector<CommandKind> kinds = command_kinds_of(client_.descriptor());
  if (kinds.empty())
    return setup_error(device + " can't be commanded", "it has no command mode with a topic");
  auto thread = rt::Thread::start({.name = "rtpm-ros2-cmd"}, [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  for (const CommandKind kind : kinds) {
    auto made =
        participant.subscribe(topic_of(device, kind), kNewest, kCommandSizeMax,
                              [this, kind](const Received& message) { take(kind, message); });
    if (!made) return unexpected{std::move(made.error())};
    subscriptions_.push_back(std::move(*made));
  }
  return {};
}

DeviceCommands::~DeviceCommands() {
  subscriptions_.clear();
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void DeviceCommands::take(CommandKind kind, const Received& message) {
  const MonotonicTime now = rt::now();
  const auto setpoint = read_command(
      kind, message.cdr, client_.descriptor(),
      {.now_ns = static_cast<std::int64_t>(rt::utc_ns(now)), .age_max = config_.age_max});
  if (!setpoint) return drop(setpoint.error());
  {
    const std::lock_guard lock(mutex_);
    if (waiting_) ++drop_counts_[static_cast<std::size_t>(CommandDrop::kReplaced)];
    waiting_ = {*setpoint, now};
  }
  changed_.notify_one();
}

void DeviceCommands::run() {
  for (;;) {
    const auto waiting = next();
    {
      const std::lock_guard lock(mutex_);
      if (is_stopping_) break;
    }
    if (waiting) {
      command(*waiting);
    } else if (rt::now() - last_ >= kPause) {
      release();
    }
  }
  release();
}

std::optional<DeviceCommands::Waiting> DeviceCommands::next() {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kPause / 4, [this] { return waiting_ || is_stopping_; });
  return std::exchange(waiting_, std::nullopt);
}

void DeviceCommands::command(const Waiting& waiting) {
  gvd::DeviceResult result = ensure_lease();
  last_ = rt::now();
  // A command that waited for the lease is as old as one that came late.
  if (result && last_ - waiting.arrived > config_.age_max) return drop(CommandDrop::kStale);
  if (result) result = client_.set(waiting.setpoint, {.deadline = kCallDeadline});
  const std::lock_guard lock(mutex_);
  if (result) {
    ++passed_count_;
    return;
  }
  if (result.error().outcome() == gvd::DeviceOutcome::kNotHolder) has_lease_ = false;
  refusal_ = gvd::to_string(result.error());
  ++drop_counts_[static_cast<std::size_t>(CommandDrop::kRefused)];
}

gvd::DeviceResult DeviceCommands::ensure_lease() {
  {
    const std::lock_guard lock(mutex_);
    if (has_lease_) return {};
  }
  const gvd::DeviceResult result =
      may_acquire_ ? client_.acquire(Duration{0}) : client_.reacquire(Duration{0});
  if (result) may_acquire_ = false;
  const std::lock_guard lock(mutex_);
  has_lease_ = result.has_value();
  return result;
}

void DeviceCommands::release() {
  may_acquire_ = true;
  {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(has_lease_, false)) return;
  }
  static_cast<void>(client_.release());
}

void DeviceCommands::drop(CommandDrop why) {
  const std::lock_guard lock(mutex_);
  ++drop_counts_[static_cast<std::size_t>(why)];
}

void DeviceCommands::report(std::vector<KeyValue>& values) const {
  const std::lock_guard lock(mutex_);
  values.push_back({"commands: lease", has_lease_ ? "held by the bridge" : "not held"});
  values.push_back({"commands passed", std::to_string(passed_count_)});
  for (std::size_t i = 0; i < kCommandDropCount; ++i) {
    values.push_back({"commands dropped: " + std::string(to_string(static_cast<CommandDrop>(i))),
                      std::to_string(drop_counts_[i])});
  }
  if (!refusal_.empty()) values.push_back({"commands: last refusal", refusal_});
}

std::string DeviceCommands::counts() const {
  const std::lock_guard lock(mutex_);
  std::string text = "passed " + std::to_string(passed_count_);
  for (std::size_t i = 0; i < kCommandDropCount; ++i) {
    if (drop_counts_[i] == 0) continue;
    text += ", " + std::string(to_string(static_cast<CommandDrop>(i))) + " " +
            std::to_string(drop_counts_[i]);
  }
  return refusal_.empty() ? text : text + " (" + refusal_ + ")";
}

}  // namespace rtpm::ros2

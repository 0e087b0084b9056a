#include "rtpm/capture/cut.hpp"

#include <algorithm>
#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <map>
#include <optional>
#include <trial.rtpm.events.hpp>
#include <utility>
#include <vector>

#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/recording/repair.hpp"
#include "rtpm/rpc/tables.hpp"

namespace rtpm::capture {
namespace {

using recording::Message;

/// Trials that run at a time; beyond, the lowest number is forgotten.
constexpr std::size_t kOpenTrialCountMax = 1024;

/// How a channel's messages before a moment tell what holds at it.
enum class Rule : std::uint8_t {
  kLast,    ///< The last one.
  kFaults,  ///< All together: each has the faults that began or ended.
  kTrials,  ///< The begins of trials that have no end.
};

std::optional<Rule> rule_of(const recording::Channel& channel) {
  const std::string kind = value_of(channel, kKindKey);
  if (kind == kDescriptionKind || kind == kParametersKind) return Rule::kLast;
  if (kind != kEventKind) return std::nullopt;
  const std::string type = value_of(channel, kTypeKey);
  const auto is_of = [&type](events::EventType number) { return type == std::to_string(number); };
  if (is_of(TrialEvent::kType)) return Rule::kTrials;
  if (is_of(gvd::kFaultChanged)) return Rule::kFaults;
  constexpr events::EventType kLasting[] = {gvd::kContactChanged, gvd::kLifecycleChanged,
                                            gvd::kLeaseChanged, gvd::kStopChanged,
                                            gvd::kModelsRendered};
  return std::ranges::any_of(kLasting, is_of) ? std::optional(Rule::kLast) : std::nullopt;
}

/// A message that outlives its reader.
struct Held {
  Message message{};
  std::vector<std::byte> bytes{};
};

/// Finds the messages before a part that tell how things stand at its begin.
class Precedents {
 public:
  Precedents(const recording::FileReader& reader, const recording::Query& part)
      : begin_ns_(part.from_ns) {
    const std::vector<std::uint16_t>& chosen = part.channel_ids;
    for (const auto& [number, channel] : reader.channels()) {
      if (!chosen.empty() && std::ranges::find(chosen, number) == chosen.end()) continue;
      if (const auto rule = rule_of(channel)) rules_.emplace(number, *rule);
    }
  }

  /// Reads the messages before the part.
  expected<void, SetupError> read(recording::FileReader& reader,
                                  const recording::Progress& progress) {
    const recording::Statistics& times = reader.statistics();
    if (rules_.empty() || begin_ns_ <= times.begin_ns || begin_ns_ > times.end_ns) return {};
    recording::Query before{.to_ns = begin_ns_ - 1};
    for (const auto& [number, rule] : rules_)
      before.channel_ids.push_back(number);
    auto read = reader.read(
        before,
        [this](const Message& message) {
          take(message);
          return byte_count_ <= kPrecedentByteMax;
        },
        progress);
    if (!read || byte_count_ <= kPrecedentByteMax) return read;
    return setup_error("the recording was not cut",
                       "the descriptions and states before the part take more than " +
                           std::to_string(kPrecedentByteMax >> 20) + " MiB",
                       "choose fewer topics, or begin at the recording's begin");
  }

  /// In the order in which they were recorded; views this object.
  [[nodiscard]] std::vector<Message> messages() {
    std::vector<Message> messages;
    for (auto& [key, held] : held_) {
      const Rule rule = rules_.at(key.first);
      if (rule == Rule::kFaults && !state_faults(held)) continue;
      Message message = held.message;
      message.data = held.bytes;
      if (rule != Rule::kTrials) message.publish_time_ns = begin_ns_;
      messages.push_back(message);
    }
    std::ranges::stable_sort(messages, {}, &Message::log_time_ns);
    for (Message& message : messages)
      message.log_time_ns = begin_ns_;
    return messages;
  }

 private:
  /// A channel, and the trial's number.
  using Key = std::pair<std::uint16_t, std::uint32_t>;

  void take(const Message& message) {
    switch (rules_.at(message.channel_id)) {
      case Rule::kLast:
        return put({message.channel_id, 0}, message);
      case Rule::kFaults:
        return take_fault(message);
      case Rule::kTrials:
        return take_trial(message);
    }
  }
  void take_fault(const Message& message) {
    device::FaultChange change;
    const ConstBytes bytes = struct_in_table(message.data, sizeof change);
    if (bytes.empty()) return;
    std::memcpy(&change, bytes.data(), sizeof change);
    std::uint32_t& faults = faults_[message.channel_id];
    faults = (faults | change.begun()) & ~change.ended();
    put({message.channel_id, 0}, message);
  }
  void take_trial(const Message& message) {
    // FlatBuffers must be read from aligned memory.
    const std::vector<std::byte> table(message.data.begin(), message.data.end());
    if (!rpc::is_valid_table<Trial>(table, TrialEvent::kLimits)) return;
    const auto* const trial = flatbuffers::GetRoot<Trial>(table.data());
    const Key key{message.channel_id, trial->number()};
    if (trial->phase() == TrialPhase::End) drop(key);
    if (trial->phase() != TrialPhase::Begin) return;
    put(key, message);
    const auto first = held_.lower_bound({message.channel_id, 0});
    const auto last = held_.upper_bound({message.channel_id, UINT32_MAX});
    if (static_cast<std::size_t>(std::distance(first, last)) > kOpenTrialCountMax) {
      drop(first->first);
    }
  }
  void put(const Key& key, const Message& message) {
    drop(key);
    byte_count_ += message.data.size();
    held_[key] = {message, {message.data.begin(), message.data.end()}};
  }
  void drop(const Key& key) {
    const auto found = held_.find(key);
    if (found == held_.end()) return;
    byte_count_ -= found->second.bytes.size();
    held_.erase(found);
  }
  /// Makes the last change one from no faults to the present ones; false if there are none.
  bool state_faults(Held& held) {
    device::FaultChange change;
    const ConstBytes inside = struct_in_table(held.bytes, sizeof change);
    std::memcpy(&change, inside.data(), sizeof change);
    const std::uint32_t faults = faults_[held.message.channel_id];
    change = device::FaultChange(change.cycle(), faults, 0);
    std::memcpy(held.bytes.data() + (inside.data() - held.bytes.data()), &change, sizeof change);
    return faults != 0;
  }

  std::uint64_t begin_ns_;
  std::map<std::uint16_t, Rule> rules_{};
  std::map<Key, Held> held_{};
  std::map<std::uint16_t, std::uint32_t> faults_{};  ///< Bits by channel.
  std::size_t byte_count_ = 0;
};

}  // namespace

expected<std::uint64_t, SetupError> cut(const std::string& from, const std::string& to,
                                        const recording::Query& query,
                                        const recording::Progress& progress) {
  auto reader = recording::FileReader::open(from, recording::Incomplete::kRefuse, progress);
  if (!reader) return unexpected{reader.error()};
  Precedents precedents(**reader, query);
  // A short pass, beside that over the part.
  const auto read = precedents.read(**reader, [&](std::uint64_t, std::uint64_t whole) {
    return !progress || progress(0, whole);
  });
  if (!read) return unexpected{read.error()};
  reader->reset();
  return recording::cut(from, to, query, precedents.messages(), progress);
}

}  // namespace rtpm::capture

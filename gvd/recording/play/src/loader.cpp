#include <algorithm>
#include <charconv>
#include <cstring>
#include <device.rtpm.hpp>
#include <map>
#include <span>
#include <utility>

#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/replay/recorded.hpp"
#include "timeline.hpp"

namespace rtpm::replay {
namespace {

using capture::value_of;
using recording::Channel;
using recording::FileReader;
using recording::Message;

/// Parses the metadata as a number; 0 if it is not one.
std::uint64_t number_of(const Channel& channel, const char* key) {
  const std::string text = value_of(channel, key);
  std::uint64_t number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  return read.ec == std::errc{} ? number : 0;
}

/// `begin_ns` plus `time`, saturating at the largest value.
std::uint64_t later(std::uint64_t begin_ns, Duration time) {
  const auto ns = static_cast<std::uint64_t>(std::max(time, Duration{0}).count());
  return begin_ns > UINT64_MAX - ns ? UINT64_MAX : begin_ns + ns;
}

bool is_kind(const Channel& channel, std::string_view kind) {
  return value_of(channel, capture::kKindKey) == kind;
}

expected<void, SetupError> check_version(const Channel& channel) {
  const bool is_description = is_kind(channel, capture::kDescriptionKind);
  const auto* const event =
      gvd::device_event_type(static_cast<events::EventType>(number_of(channel, capture::kTypeKey)));
  if (!is_description && event == nullptr) return {};
  const std::uint64_t here =
      is_description ? device::DeviceClient::interface().fingerprint : event->schema_id;
  const std::uint64_t there = number_of(channel, capture::kSchemaIdKey);
  if (here == there) return {};
  const std::string name =
      is_description ? "rtpm.device.Device" : value_of(channel, capture::kNameKey);
  return setup_error(channel.topic + " was recorded with another version of " + name,
                     program::formatted("its fingerprint there is %016llx, in this program %016llx",
                                        static_cast<unsigned long long>(there),
                                        static_cast<unsigned long long>(here)),
                     "play it with the release that recorded it");
}

/// Fills a Recorded from a file.
class Loader {
 public:
  Loader(FileReader& reader, const Selection& selection, const recording::Progress& progress,
         std::string path)
      : reader_(reader), selection_(selection), progress_(progress), path_(std::move(path)) {}

  expected<Recorded, SetupError> load() {
    if (auto checked = check(); !checked) return unexpected{checked.error()};
    if (auto described = read_descriptions(); !described) return unexpected{described.error()};
    if (auto chosen = choose_devices(); !chosen) return unexpected{chosen.error()};
    choose_channels();
    if (channels_.empty()) return unexpected{nothing_to_play()};
    if (auto read = read_messages(); !read) return unexpected{read.error()};
    tell_left_out();
    if (recorded_.devices.empty() && recorded_.events.empty()) {
      return unexpected{nothing_to_play()};
    }
    mend_times(recorded_);
    return std::move(recorded_);
  }

 private:
  struct Target {
    std::optional<std::size_t> device{};  ///< The device whose samples the channel has.
    std::optional<std::size_t> source{};  ///< The source whose events the channel has.
    std::size_t struct_size = 0;
    std::uint64_t broken_count = 0;
    std::uint64_t back_count = 0;
    std::uint32_t sequence = 0;
  };

  [[nodiscard]] std::vector<std::string> device_names() const {
    std::vector<std::string> names;
    for (const auto& [name, description] : descriptions_)
      names.push_back(name);
    return names;
  }

  expected<void, SetupError> check() const {
    std::vector<std::string> topics;
    for (const auto& [number, channel] : reader_.channels()) {
      if (auto checked = check_version(channel); !checked) return checked;
      if (is_kind(channel, capture::kEventKind)) topics.push_back(channel.topic);
    }
    for (const std::string& topic : selection_.topics) {
      if (std::ranges::count(topics, topic) > 0) continue;
      return setup_error(path_ + " has no events of topic '" + topic + "'" +
                         program::suggestion(topic, topics) + "; 'rtpm bag info' shows all");
    }
    return {};
  }

  expected<void, SetupError> read_descriptions() {
    recording::Query query;
    for (const auto& [number, channel] : reader_.channels()) {
      if (is_kind(channel, capture::kDescriptionKind)) query.channel_ids.push_back(number);
    }
    if (query.channel_ids.empty()) return {};
    const auto take_description = [&](const Message& message) {
      const Channel& channel = reader_.channels().at(message.channel_id);
      std::vector<std::byte> bytes(message.data.begin(), message.data.end());
      if (rpc::is_valid_table<device::Description>(bytes)) {
        descriptions_.try_emplace(value_of(channel, capture::kDeviceKey), std::move(bytes));
      } else {
        recorded_.notes.push_back(channel.topic + ": a description is broken and left out");
      }
      return true;
    };
    return reader_.read(query, take_description, progress_);
  }

  expected<void, SetupError> choose_devices() {
    const std::vector<std::string> names = device_names();
    for (const std::string& name : selection_.devices) {
      if (std::ranges::count(names, name) > 0) continue;
      return setup_error(path_ + " has no device '" + name + "'" +
                         program::suggestion(name, names) + "; 'rtpm bag info' shows all topics");
    }
    for (auto& [name, description] : descriptions_) {
      const bool is_chosen =
          selection_.devices.empty() || std::ranges::count(selection_.devices, name) > 0;
      if (is_chosen) recorded_.devices.push_back({name, std::move(description)});
    }
    return {};
  }

  /// The selected device with this event source.
  [[nodiscard]] std::optional<std::size_t> device_of(const Channel& channel) const {
    const bool is_polled = is_kind(channel, capture::kSampleKind);
    if (!is_polled && !capture::is_device_event(
                          static_cast<std::uint32_t>(number_of(channel, capture::kTypeKey)))) {
      return std::nullopt;
    }
    const std::uint64_t source = number_of(channel, capture::kSourceKey);
    for (std::size_t i = 0; i < recorded_.devices.size(); ++i) {
      if (gvd::source_of(recorded_.devices[i].name) == source) return i;
    }
    return std::nullopt;
  }

  void choose_channels() {
    for (const auto& [number, channel] : reader_.channels()) {
      if (!is_kind(channel, capture::kEventKind) && !is_kind(channel, capture::kSampleKind))
        continue;
      Target target;
      target.struct_size = number_of(channel, capture::kStructSizeKey);
      const auto device = device_of(channel);
      if (device && number_of(channel, capture::kTypeKey) == gvd::kSampled) target.device = device;
      if (is_event_chosen(channel, device.has_value())) {
        target.source = recorded_.sources.size();
        recorded_.sources.push_back(source_of(channel, device));
      }
      if (target.device || target.source) channels_.emplace(number, target);
    }
    leave_out_polled();
  }

  [[nodiscard]] bool is_event_chosen(const Channel& channel, bool has_device) const {
    if (!is_kind(channel, capture::kEventKind)) return false;
    if (!selection_.topics.empty()) {
      return std::ranges::count(selection_.topics, channel.topic) > 0;
    }
    // Selecting devices also selects their events.
    return has_device || selection_.devices.empty();
  }

  [[nodiscard]] RecordedSource source_of(const Channel& channel,
                                         std::optional<std::size_t> device) const {
    const std::uint64_t priority = number_of(channel, capture::kPriorityKey);
    return {.topic = channel.topic,
            .type_name = value_of(channel, capture::kNameKey),
            .type = static_cast<events::EventType>(number_of(channel, capture::kTypeKey)),
            .source = static_cast<events::SourceId>(number_of(channel, capture::kSourceKey)),
            .schema_id = number_of(channel, capture::kSchemaIdKey),
            .priority = static_cast<int>(std::min<std::uint64_t>(priority, Priority::kHighest)),
            .device = device ? recorded_.devices[*device].name : std::string{}};
  }

  /// If a device was polled and also pushed events, its samples exist twice: keeps the pushed ones,
  /// which are complete.
  void leave_out_polled() {
    for (auto& [number, target] : channels_) {
      if (!target.device || !is_kind(reader_.channels().at(number), capture::kSampleKind)) continue;
      const bool is_pushed = std::ranges::any_of(channels_, [&](const auto& other) {
        return other.second.device == target.device &&
               is_kind(reader_.channels().at(other.first), capture::kEventKind);
      });
      if (is_pushed) target.device.reset();
    }
  }

  [[nodiscard]] SetupError nothing_to_play() const {
    std::string why;
    for (const std::string& note : recorded_.notes)
      why += (why.empty() ? "" : "; ") + note;
    return {.what = path_ + " has no device or event to play",
            .why = why,
            .remedy = "record one with rtpm record"};
  }

  expected<void, SetupError> read_messages() {
    begin_ns_ = reader_.statistics().begin_ns;
    recording::Query query{.from_ns = later(begin_ns_, selection_.from)};
    if (selection_.to) query.to_ns = later(begin_ns_, *selection_.to);
    for (const auto& [number, target] : channels_)
      query.channel_ids.push_back(number);
    bool is_full = false;
    auto read = reader_.read(
        query,
        [&](const Message& message) {
          take(message);
          is_full = byte_count_ > kLoadByteMax;
          return !is_full;
        },
        progress_);
    if (!read) return read;
    if (!is_full) return {};
    return setup_error(path_ + " is larger than what is played at once",
                       "samples and events take more than 1 GiB",
                       "play a part of it: --from, --to or --devices");
  }

  void take(const Message& message) {
    Target& target = channels_.at(message.channel_id);
    ConstBytes payload = message.data;
    if (target.struct_size > 0) payload = capture::struct_in_table(payload, target.struct_size);
    const bool is_sample = target.device.has_value();
    if ((target.struct_size > 0 && payload.empty()) ||
        (is_sample && payload.size() != sizeof(device::Sample))) {
      ++target.broken_count;
      return;
    }
    if (message.sequence != 0 && message.sequence < target.sequence) ++target.back_count;
    target.sequence = message.sequence;
    const Duration at = time_of(message.log_time_ns, message.publish_time_ns, begin_ns_);
    if (is_sample) {
      RecordedDevice& device = recorded_.devices[*target.device];
      std::memcpy(&device.samples.emplace_back(), payload.data(), sizeof(device::Sample));
      device.times.push_back(at);
      byte_count_ += sizeof(device::Sample) + sizeof at;
    }
    if (target.source) {
      recorded_.events.push_back({.source = *target.source,
                                  .at = at,
                                  .offset = recorded_.payloads.size(),
                                  .size = payload.size()});
      recorded_.payloads.insert(recorded_.payloads.end(), payload.begin(), payload.end());
      byte_count_ += payload.size() + sizeof(RecordedEvent);
    }
  }

  void tell_left_out() {
    for (const auto& [number, target] : channels_) {
      const std::string& topic = reader_.channels().at(number).topic;
      if (target.broken_count > 0) {
        recorded_.notes.push_back(topic + ": " + std::to_string(target.broken_count) +
                                  " messages are broken and left out");
      }
      if (target.back_count > 0) {
        recorded_.notes.push_back(topic + ": the sequence numbers go back " +
                                  std::to_string(target.back_count) +
                                  " times, as its source was restarted or the recorder's clock "
                                  "went back; played in the order of the file's times");
      }
    }
    std::erase_if(recorded_.devices, [&](const RecordedDevice& device) {
      if (!device.samples.empty()) return false;
      recorded_.notes.push_back(device.name + " has no sample in this part and is left out");
      return true;
    });
  }

  FileReader& reader_;
  const Selection& selection_;
  const recording::Progress& progress_;
  std::string path_;
  std::map<std::string, std::vector<std::byte>> descriptions_{};
  std::map<std::uint16_t, Target> channels_{};
  Recorded recorded_{};
  std::size_t byte_count_ = 0;
  std::uint64_t begin_ns_ = 0;  ///< The first time in the file.
};

}  // namespace

expected<Recorded, SetupError> load(const std::string& path, const Selection& selection,
                                    const recording::Progress& progress) {
  auto reader = FileReader::open(path, recording::Incomplete::kRefuse, progress);
  if (!reader) return unexpected{reader.error()};
  return Loader(**reader, selection, progress, path).load();
}

}  // namespace rtpm::replay

#include "review/review.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "recording/folder.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"

namespace rtpm::console {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr std::size_t kUnreadableCountMax = 32;
constexpr std::size_t kBucketCountMin = 1024;
/// How far the times of measurement and of recording may be apart.
constexpr std::uint64_t kDelayMaxNs = 1'000'000'000;

std::uint64_t earlier(std::uint64_t time_ns, std::uint64_t by_ns) noexcept {
  return time_ns - std::min(time_ns, by_ns);
}
std::uint64_t later(std::uint64_t time_ns, std::uint64_t by_ns) noexcept {
  return time_ns + std::min(by_ns, UINT64_MAX - time_ns);
}

/// Whether the page shows the channel's fields: not those of pictures, nor those made for viewers.
bool has_fields(const recording::Channel& channel) {
  const std::string kind = capture::value_of(channel, capture::kKindKey);
  return kind != capture::kViewKind && kind != capture::kMediumKind &&
         kind != capture::kDescriptionKind;
}

}  // namespace

void Review::Bucket::take(double other_low, double other_high) noexcept {
  if (is_empty()) {
    low = other_low;
    high = other_high;
  } else {
    low = std::min(low, other_low);
    high = std::max(high, other_high);
  }
}

/// A field of a window while that is read.
struct Review::WindowField {
  std::size_t number = 0;
  std::size_t index = 0;  ///< In the channel's values.
  std::vector<Bucket> buckets{};
  std::vector<std::pair<std::uint64_t, double>> samples{};  ///< Until there are too many.
  std::size_t sample_count = 0;
  std::optional<std::pair<std::uint64_t, double>> before{};
  std::optional<std::pair<std::uint64_t, double>> after{};
};

expected<std::shared_ptr<Review>, SetupError> Review::open(const std::string& path,
                                                           const recording::Progress& progress) {
  auto reader = recording::FileReader::open(path, recording::Incomplete::kRead, progress);
  if (!reader) return unexpected{reader.error()};
  std::shared_ptr<Review> review(new Review(std::move(*reader), path));
  review->find_fields(progress);
  return review;
}

Review::Review(std::unique_ptr<recording::FileReader> reader, std::string path)
    : path_(std::move(path)),
      reader_(std::move(reader)),
      statistics_(reader_->statistics()),
      is_complete_(reader_->is_complete()),
      marks_(*reader_) {}

void Review::find_fields(const recording::Progress& progress) {
  // Without them the elements of samples' arrays have numbers instead of names.
  const auto devices = exports::read_devices(*reader_, progress);
  std::map<std::pair<std::uint16_t, const driver::Descriptor*>,
           std::shared_ptr<const exports::ScalarReader>>
      readers;
  for (const auto& [number, channel] : reader_->channels()) {
    const auto schema = reader_->schemas().find(channel.schema_id);
    if (schema == reader_->schemas().end() || schema->second.encoding != "flatbuffer" ||
        !has_fields(channel)) {
      continue;
    }
    const driver::Descriptor* const device =
        devices ? exports::device_of(*devices, *reader_, channel) : nullptr;
    auto& reader = readers[{channel.schema_id, device}];
    if (!reader) {
      auto created = exports::ScalarReader::create(schema->second, device);
      if (!created) {
        if (unreadable_topics_.size() < kUnreadableCountMax) {
          unreadable_topics_.push_back(printable(channel.topic));
        }
        continue;
      }
      reader = std::make_shared<const exports::ScalarReader>(std::move(*created));
    }
    Decoder decoder{.reader = reader, .first = fields_.size()};
    for (const exports::ScalarField& field : reader->fields()) {
      if (fields_.size() >= kFieldCountMax) {
        ++omitted_field_count_;
        continue;
      }
      std::string path = printable(channel.topic) + "." + printable(field.path);
      numbers_.try_emplace(path, fields_.size());
      fields_.push_back({std::move(path), printable(field.unit), number, decoder.count++});
    }
    values_.resize(std::max(values_.size(), reader->fields().size()));
    decoders_.emplace(number, std::move(decoder));
  }
  const std::size_t share = kBucketCountMax / std::max<std::size_t>(fields_.size(), 1);
  bucket_count_ = std::clamp(std::bit_floor(share), kBucketCountMin, kFieldBucketCountMax);
  bucket_ns_ = earlier(statistics_.end_ns, statistics_.begin_ns) / bucket_count_ + 1;
  overview_.resize(fields_.size());
  if (const auto metadata = reader_->read_metadata()) {
    for (const recording::Metadata& one : *metadata) {
      if (one.name == kSessionMetadata) session_ = one.values;
    }
  }
}

std::uint64_t Review::time_of(const recording::Message& message) const noexcept {
  const std::uint64_t log_ns = message.log_time_ns;
  const std::uint64_t sent_ns = message.publish_time_ns;
  const bool is_near =
      earlier(log_ns, sent_ns) <= kDelayMaxNs && earlier(sent_ns, log_ns) <= kDelayMaxNs;
  return std::clamp(is_near ? sent_ns : log_ns, statistics_.begin_ns,
                    std::max(statistics_.begin_ns, statistics_.end_ns));
}

std::size_t Review::bucket_at(std::uint64_t time_ns) const noexcept {
  return std::min<std::size_t>(earlier(time_ns, statistics_.begin_ns) / bucket_ns_,
                               bucket_count_ - 1);
}

void Review::take(const recording::Message& message) {
  const std::uint64_t time_ns = time_of(message);
  const auto decoder = decoders_.find(message.channel_id);
  const bool is_read =
      decoder != decoders_.end() &&
      decoder->second.reader->read(
          message.data, std::span(values_).first(decoder->second.reader->fields().size()));
  const std::lock_guard lock(mutex_);
  marks_.take(message, time_ns);
  if (!is_read) return;
  const std::size_t at = bucket_at(time_ns);
  for (std::size_t i = 0; i < decoder->second.count; ++i) {
    if (!std::isfinite(values_[i])) continue;
    std::vector<Bucket>& buckets = overview_[decoder->second.first + i];
    if (buckets.empty()) buckets.resize(bucket_count_);
    buckets[at].take(values_[i]);
  }
}

expected<void, SetupError> Review::read_overview(const recording::Progress& progress) {
  const auto read = reader_->read(
      {},
      [this](const recording::Message& message) {
        take(message);
        return true;
      },
      [&](std::uint64_t done, std::uint64_t whole) {
        {
          const std::lock_guard lock(mutex_);
          progress_ =
              static_cast<double>(done) / static_cast<double>(std::max<std::uint64_t>(whole, 1));
        }
        return !progress || progress(done, whole);
      });
  const std::lock_guard lock(mutex_);
  progress_ = 1;
  if (!read) problem_ = read.error().text();
  return read;
}

OrderedJson Review::summary() const {
  OrderedJson fields = OrderedJson::array();
  for (const Field& field : fields_)
    fields.push_back({{"path", field.path}, {"unit", field.unit}});
  const std::lock_guard lock(mutex_);
  OrderedJson json{{"begin_ns", statistics_.begin_ns},
                   {"end_ns", statistics_.end_ns},
                   {"message_count", statistics_.message_count},
                   {"is_complete", is_complete_},
                   {"problem", problem_},
                   {"progress", progress_},
                   {"session", session_},
                   {"fields", std::move(fields)},
                   {"omitted_field_count", omitted_field_count_},
                   {"unreadable_topics", unreadable_topics_}};
  json.update(marks_.json());
  return json;
}

std::string Review::unknown_in(const std::vector<std::string>& fields) const {
  const auto unknown =
      std::ranges::find_if(fields, [this](const auto& each) { return !numbers_.contains(each); });
  return unknown == fields.end() ? "" : *unknown;
}

bool Review::is_overview_fine(const Window& window) const noexcept {
  const std::uint64_t point_ns = (window.end_ns - window.begin_ns) / window.point_count;
  return point_ns >= bucket_ns_ / 2;
}

OrderedJson Review::buckets_json(std::span<const Bucket> buckets) {
  OrderedJson low = OrderedJson::array();
  OrderedJson high = OrderedJson::array();
  for (const Bucket& bucket : buckets) {
    low.push_back(bucket.is_empty() ? OrderedJson() : OrderedJson(bucket.low));
    high.push_back(bucket.is_empty() ? OrderedJson() : OrderedJson(bucket.high));
  }
  return {{"low", std::move(low)}, {"high", std::move(high)}};
}

OrderedJson Review::overview(const Window& window) const {
  const std::size_t first = bucket_at(window.begin_ns);
  const std::size_t last = bucket_at(window.end_ns);
  // Buckets that are joined stay the same while the window moves.
  const std::size_t step = std::bit_ceil((last - first) / window.point_count + 1);
  const std::size_t begin = first / step * step;
  const std::size_t count = (last - begin) / step + 1;
  OrderedJson series = OrderedJson::array();
  const std::lock_guard lock(mutex_);
  for (const std::string& path : window.fields) {
    const std::vector<Bucket>& buckets = overview_[numbers_.find(path)->second];
    std::vector<Bucket> joined(count);
    for (std::size_t i = begin; i <= last && i < buckets.size(); ++i) {
      if (!buckets[i].is_empty()) joined[(i - begin) / step].take(buckets[i].low, buckets[i].high);
    }
    OrderedJson json{{"field", path}};
    json.update(buckets_json(joined));
    series.push_back(std::move(json));
  }
  return {{"begin_ns", statistics_.begin_ns + begin * bucket_ns_},
          {"bucket_ns", step * bucket_ns_},
          {"is_exact", false},
          {"progress", progress_},
          {"series", std::move(series)}};
}

expected<OrderedJson, SetupError> Review::read(const Window& window,
                                               const recording::Progress& progress) {
  if (!window_reader_) {
    auto reader = recording::FileReader::open(path_, recording::Incomplete::kRead, progress);
    if (!reader) return unexpected{reader.error()};
    window_reader_ = std::move(*reader);
  }
  const std::uint64_t bucket_ns = (window.end_ns - window.begin_ns) / window.point_count + 1;
  std::map<std::uint16_t, std::vector<WindowField>> wanted;
  Marks marks(*window_reader_);
  recording::Query query{.from_ns = earlier(window.begin_ns, kDelayMaxNs),
                         .to_ns = later(window.end_ns, kDelayMaxNs),
                         .channel_ids = marks.channels()};
  for (const std::string& path : window.fields) {
    const std::size_t number = numbers_.find(path)->second;
    const Field& field = fields_[number];
    if (!wanted.contains(field.channel)) query.channel_ids.push_back(field.channel);
    WindowField& added = wanted[field.channel].emplace_back();
    added.number = number;
    added.index = field.index;
    added.buckets.resize(window.point_count);
  }
  std::vector<double> values(values_.size());
  const auto take = [&](const recording::Message& message) {
    const std::uint64_t time_ns = time_of(message);
    const bool is_inside = time_ns >= window.begin_ns && time_ns <= window.end_ns;
    if (is_inside) marks.take(message, time_ns);
    const auto fields = wanted.find(message.channel_id);
    if (fields == wanted.end()) return true;
    const exports::ScalarReader& reader = *decoders_.at(message.channel_id).reader;
    if (!reader.read(message.data, std::span(values).first(reader.fields().size()))) return true;
    for (WindowField& field : fields->second) {
      const double value = values[field.index];
      if (!std::isfinite(value)) continue;
      const std::pair sample{time_ns, value};
      if (time_ns < window.begin_ns) {
        if (!field.before || field.before->first <= time_ns) field.before = sample;
      } else if (time_ns > window.end_ns) {
        if (!field.after || field.after->first > time_ns) field.after = sample;
      } else {
        field.buckets[(time_ns - window.begin_ns) / bucket_ns].take(value);
        if (++field.sample_count <= window.point_count) field.samples.push_back(sample);
      }
    }
    return true;
  };
  const auto done = window_reader_->read(query, take, progress);
  if (!done) return unexpected{done.error()};
  OrderedJson series = OrderedJson::array();
  for (const std::string& path : window.fields) {
    const std::size_t number = numbers_.find(path)->second;
    WindowField& field =
        *std::ranges::find(wanted[fields_[number].channel], number, &WindowField::number);
    OrderedJson json{{"field", path}};
    if (field.sample_count > window.point_count) {
      json.update(buckets_json(field.buckets));
    } else {
      std::ranges::stable_sort(field.samples, {}, &std::pair<std::uint64_t, double>::first);
      // With the samples next to the window, its curve reaches the edges.
      if (field.before) field.samples.insert(field.samples.begin(), *field.before);
      if (field.after) field.samples.push_back(*field.after);
      OrderedJson times = OrderedJson::array();
      OrderedJson samples = OrderedJson::array();
      for (const auto& [time_ns, value] : field.samples) {
        times.push_back(static_cast<std::int64_t>(time_ns - window.begin_ns));
        samples.push_back(value);
      }
      json["offset_ns"] = std::move(times);
      json["values"] = std::move(samples);
    }
    series.push_back(std::move(json));
  }
  OrderedJson json{{"begin_ns", window.begin_ns},
                   {"bucket_ns", bucket_ns},
                   {"is_exact", true},
                   {"progress", 1.0},
                   {"series", std::move(series)}};
  json.update(marks.json());
  return json;
}

}  // namespace rtpm::console

#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "review/marks.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/exports/scalars.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::console {

/// A recording under review: its fields, what happened, and an overview of each field that one pass
/// over the file makes. Finer windows are read from the file.
/// @threads  read_overview() on one, read() on one at a time, all else on any
class Review {
 public:
  /// Further fields are left out, and counted.
  static constexpr std::size_t kFieldCountMax = 1024;
  /// The buckets of an overview, of all fields together: 16 bytes each.
  static constexpr std::size_t kBucketCountMax = 1 << 20;
  static constexpr std::size_t kFieldBucketCountMax = 1 << 13;
  /// The points of an answer, of all its fields together.
  static constexpr std::size_t kPointCountMax = 1 << 16;

  /// Opens a recording, also an incomplete one, which is read once for that.
  /// @errors   those of FileReader::open()
  [[nodiscard]] static expected<std::shared_ptr<Review>, SetupError> open(
      const std::string& path, const recording::Progress& progress);
  Review(const Review&) = delete;
  Review& operator=(const Review&) = delete;

  /// Reads the whole file; answers have what it has read so far.
  /// @errors   a damaged chunk: what was read before it stays; stopped
  [[nodiscard]] expected<void, SetupError> read_overview(const recording::Progress& progress);

  /// The recording's facts, fields and marks.
  [[nodiscard]] nlohmann::ordered_json summary() const;

  /// A part of the recording, as curves.
  struct Window {
    std::uint64_t begin_ns = 0;
    std::uint64_t end_ns = 0;  ///< Above `begin_ns`.
    std::vector<std::string> fields{};
    std::size_t point_count = 0;  ///< The most of each field, above 0.
  };
  /// The first of the fields that the recording does not have; empty if it has all.
  [[nodiscard]] std::string unknown_in(const std::vector<std::string>& fields) const;
  /// Whether the overview has at least half as many buckets in the window as it has points.
  [[nodiscard]] bool is_overview_fine(const Window& window) const noexcept;
  /// The window's part of the overview.
  [[nodiscard]] nlohmann::ordered_json overview(const Window& window) const;
  /// Reads the window's chunks: minima and maxima of buckets or, of a field with at most
  /// `point_count` samples there, the samples.
  /// @errors   a damaged chunk in the window; stopped
  [[nodiscard]] expected<nlohmann::ordered_json, SetupError> read(
      const Window& window, const recording::Progress& progress);

 private:
  /// The least and the greatest value in a time.
  struct Bucket {
    double low = 0;
    double high = -1;  ///< Below `low` if there is no value.
    void take(double value) noexcept { take(value, value); }
    void take(double other_low, double other_high) noexcept;
    [[nodiscard]] bool is_empty() const noexcept { return high < low; }
  };
  struct Field {
    std::string path{};  ///< "lab/arm0/sampled.position_m.x".
    std::string unit{};
    std::uint16_t channel = 0;
    std::size_t index = 0;  ///< In the channel's values.
  };
  /// Reads a channel's messages, whose fields are those from `first` on.
  struct Decoder {
    std::shared_ptr<const exports::ScalarReader> reader{};
    std::size_t first = 0;
    std::size_t count = 0;  ///< Less than the message has, if there are too many fields.
  };
  struct WindowField;

  explicit Review(std::unique_ptr<recording::FileReader> reader, std::string path);
  void find_fields(const recording::Progress& progress);
  [[nodiscard]] static nlohmann::ordered_json buckets_json(std::span<const Bucket> buckets);
  /// The time of measurement or, if that can't be, of recording; not outside of the recording.
  [[nodiscard]] std::uint64_t time_of(const recording::Message& message) const noexcept;
  void take(const recording::Message& message);
  [[nodiscard]] std::size_t bucket_at(std::uint64_t time_ns) const noexcept;

  const std::string path_;
  std::unique_ptr<recording::FileReader> reader_;           ///< For the overview's thread.
  std::unique_ptr<recording::FileReader> window_reader_{};  ///< For the window's thread.
  const recording::Statistics statistics_;
  const bool is_complete_;
  std::map<std::uint16_t, Decoder> decoders_{};
  std::vector<Field> fields_{};
  std::map<std::string, std::size_t, std::less<>> numbers_{};  ///< Indices of fields, by path.
  std::size_t omitted_field_count_ = 0;
  std::vector<std::string> unreadable_topics_{};
  std::map<std::string, std::string> session_{};
  std::size_t bucket_count_ = 1;
  std::uint64_t bucket_ns_ = 1;
  std::vector<double> values_{};  ///< For the overview's thread.

  mutable std::mutex mutex_{};
  // Guarded by `mutex_`:
  std::vector<std::vector<Bucket>> overview_{};  ///< By field; empty before its first value.
  Marks marks_;
  double progress_ = 0;
  std::string problem_{};
};

}  // namespace rtpm::console

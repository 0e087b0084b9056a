#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::console {

/// At most kMax of any number of items, evenly chosen: when full, every second one goes.
template <class T>
class Thinned {
 public:
  static constexpr std::size_t kMax = 2048;

  void add(T item) {
    if (count_++ % stride_ != 0) return;
    if (kept_.size() == kMax) {
      for (std::size_t i = 1; 2 * i < kMax; ++i)
        kept_[i] = std::move(kept_[2 * i]);
      kept_.resize(kMax / 2);
      stride_ *= 2;
    }
    kept_.push_back(std::move(item));
  }
  /// Counts also those that are not kept.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] const std::vector<T>& kept() const noexcept { return kept_; }

 private:
  std::uint64_t count_ = 0;
  std::uint64_t stride_ = 1;
  std::vector<T> kept_{};
};

/// The happenings in a recording: markers, trials, and the devices' incidents.
/// @threads  one at a time
class Marks {
 public:
  /// @param reader  tells the channels; not kept
  explicit Marks(const recording::FileReader& reader);

  /// Takes a message if its channel has markers, trials or incidents.
  void take(const recording::Message& message, std::uint64_t time_ns);
  /// The channels of which take() uses the messages.
  [[nodiscard]] std::vector<std::uint16_t> channels() const;
  /// {"markers":[…],"marker_count",…}: thinned lists, and how many there are.
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  enum class Role : std::uint8_t { kTrial, kNote, kFault, kStop, kLease };
  struct Source {
    Role role{};
    std::string device{};
    std::uint64_t event_source = 0;
  };
  struct Marker {
    std::uint64_t time_ns = 0;
    std::string label{};
  };
  struct Span {
    std::uint64_t begin_ns = 0;
    std::optional<std::uint64_t> end_ns{};  ///< nullopt if the end is not recorded.
    std::uint32_t number = 0;
    std::string condition{};
    std::string response{};
  };
  struct Incident {
    std::uint64_t begin_ns = 0;
    std::optional<std::uint64_t> end_ns{};  ///< nullopt if it has no length, or lasts.
    std::string kind{};                     ///< "fault", "stop", "lost" or "lease".
    std::string device{};
    std::string what{};
  };
  /// A device, and its fault's bit or kStopBit.
  using Open = std::pair<std::string, unsigned>;

  void take_trial(const Source& source, ConstBytes table, std::uint64_t time_ns);
  void take_note(ConstBytes json, std::uint64_t time_ns);
  void take_fault(const Source& source, ConstBytes table, std::uint64_t time_ns);
  void take_stop(const Source& source, ConstBytes table, std::uint64_t time_ns);
  void take_lease(const Source& source, ConstBytes table, std::uint64_t time_ns);
  void begin(const Open& open, Incident incident);
  void end(const Open& open, std::uint64_t time_ns);

  std::map<std::uint16_t, Source> sources_{};
  Thinned<Marker> markers_{};
  Thinned<Span> trials_{};
  Thinned<Incident> incidents_{};
  std::map<std::pair<std::uint64_t, std::uint32_t>, Span> open_trials_{};  ///< By source, number.
  std::map<Open, Incident> open_incidents_{};
};

}  // namespace rtpm::console

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/supplier.hpp"

namespace rtpm::events {

enum class TrialPhase : std::uint8_t {
  kMark,  ///< Something happened, in a trial or outside.
  kBegin,
  kEnd
};

/// A step of an experiment; the event rtpm.Trial. Empty texts are left out.
/// @source schema/idl/trial.fbs
struct Trial {
  TrialPhase phase = TrialPhase::kMark;
  std::uint32_t number = 0;  ///< The trial's, from 1; 0: outside of trials.
  std::string condition{};
  std::string response{};
  std::optional<std::uint64_t> seed{};
  std::string note{};
  std::optional<Duration> duration{};  ///< An end has it: the time since the beginning.
};

/// Pushes the steps of an experiment to a hub:
/// `trials->push({.phase = TrialPhase::kBegin, .number = 3, .condition = "soft"})`.
/// @ownership refers to its node, which must outlive it
/// @threads  any
class TrialSupplier {
 public:
  /// Binds the hub at `target`, a URL or a name.
  /// @param source tells the experiments at one hub apart
  /// @realtime set-up only
  /// @errors   those of Supplier::create()
  [[nodiscard]] static expected<TrialSupplier, SetupError> create(
      rpc::Node& node, const std::string& target = std::string(kHubPath), SourceId source = 0,
      SupplierConfig config = {.name = "trials"});
  /// Pushes a step that was taken at `origin`; nullopt means now.
  /// @realtime allocates; not for real-time threads
  /// @errors   those of Supplier::push()
  [[nodiscard]] expected<void, rpc::CallError> push(const Trial& trial,
                                                    std::optional<MonotonicTime> origin = {});

 private:
  TrialSupplier(std::unique_ptr<Supplier> supplier, SourceId source) noexcept;
  std::unique_ptr<Supplier> supplier_;
  SourceId source_;
};

}  // namespace rtpm::events

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/status.hpp"

// The call tap: records the calls of a running server for another thread to read.
namespace rtpm::rpc {

/// An object whose calls are tapped.
struct TappedObject {
  std::string path{};
  std::vector<std::uint16_t> methods{};  ///< The numbers of the methods; empty for all methods.
};

/// The calls to record, and how much of each.
struct TapConfig {
  std::vector<TappedObject> objects{};  ///< Empty for all objects.
  /// An object that is never recorded: the one that forwards the records would otherwise record
  /// itself.
  std::string excluded_path{};
  bool has_payloads = true;
  /// A larger payload is omitted and counted. At most an eighth of the ring.
  std::uint32_t payload_byte_max = 64 * 1024;
  /// The size of a ring: a power of two, 4 KiB…256 MiB. A call that finds the ring full is dropped
  /// and counted. A lane with one thread has one ring, a lane with a pool four.
  std::uint32_t ring_byte_count = 1024 * 1024;
};

/// The part of a call that a record covers.
enum class TapStage : std::uint8_t {
  kWhole,  ///< Request and reply.
  kBegun,  ///< The request of a call that is answered later or with a stream.
  kItem,   ///< An item of a stream, as the reply.
  kEnded,  ///< The end of a deferred call or a stream.
};

/// One record of the tap.
struct TappedCall {
  TapStage stage = TapStage::kWhole;
  wire::Status status = wire::Status::kOk;  ///< The result of a whole or ended call.
  /// The call's number, from 1; all its records have it. Numbers ascend in a lane with one thread;
  /// a server with one such lane skips none.
  std::uint64_t number = 0;
  std::uint32_t service = 0;  ///< The object's number, as bound: the index in objects(), plus 1.
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t session = 0;
  std::uint64_t trace_id = 0;
  MonotonicTime received{};
  /// When the method ended, or the item was sent. For kBegun, when the method returned.
  MonotonicTime finished{};
  std::uint32_t request_size = 0;  ///< Set even if the payload was omitted.
  std::uint32_t reply_size = 0;
  ConstBytes request{};  ///< Empty if omitted.
  ConstBytes reply{};
};

/// A tap's losses since it was switched on.
struct TapLosses {
  std::uint64_t dropped_count = 0;  ///< Records that found the ring full, or all rings in use.
  std::uint64_t omitted_payload_count = 0;  ///< Payloads that were too long.
};

/// The tap of a server: while it is on, each lane copies its calls into its own rings, and one
/// thread reads them. A lane never waits for the reader, allocates nothing and makes no system
/// call. The tap records calls that reached a method, including those within the program. Refused
/// calls appear in the server's counters only.
/// @ownership may outlive its server, whose destruction switches it off permanently
/// @threads  one at a time
/// @realtime none for its own methods; a lane's part is wait-free, alloc-free and makes no syscall;
///           while the tap is off it costs a load and a branch
class CallTap {
 public:
  CallTap() = default;
  CallTap(const CallTap&) = delete;
  CallTap& operator=(const CallTap&) = delete;
  virtual ~CallTap() = default;

  /// Allocates the rings; the lanes record from now on.
  /// @errors   already on; the server has stopped; no such object; a size out of range
  [[nodiscard]] virtual expected<void, SetupError> switch_on(const TapConfig& config) = 0;
  /// Frees the rings, after waiting at most a second for lanes that are writing. Does nothing when
  /// off.
  virtual void switch_off() noexcept = 0;
  /// Whether the tap is on; false once the server has stopped.
  [[nodiscard]] virtual bool is_on() const noexcept = 0;
  /// The next record, valid until the next call; nullopt while there is none.
  [[nodiscard]] virtual std::optional<TappedCall> next() noexcept = 0;
  [[nodiscard]] virtual TapLosses losses() noexcept = 0;
  /// The paths of the objects that the server had at switch_on().
  [[nodiscard]] virtual const std::vector<std::string>& objects() const noexcept = 0;
};

}  // namespace rtpm::rpc

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
  std::vector<std::uint16_t> methods{};  ///< By number; empty for all.
};

/// The calls that are tapped, and how much of them.
struct TapConfig {
  std::vector<TappedObject> objects{};  ///< Empty for all.
  /// Never tapped: the object that sends the calls on would otherwise record itself.
  std::string excluded_path{};
  bool has_payloads = true;
  /// A larger payload is left out and counted. At most an eighth of the ring.
  std::uint32_t payload_byte_max = 64 * 1024;
  /// The size of a ring: a power of two, 4 KiB…256 MiB. A call that finds it full is dropped and
  /// counted. A lane of one thread has one ring, a lane with a pool four.
  std::uint32_t ring_byte_count = 1024 * 1024;
};

/// How much of a call a record has.
enum class TapStage : std::uint8_t {
  kWhole,  ///< Request and reply.
  kBegun,  ///< The request of a call that is answered later or by a stream.
  kItem,   ///< An item of a stream, as the reply.
  kEnded,  ///< The end of a call that had begun.
};

/// One record of the tap.
struct TappedCall {
  TapStage stage = TapStage::kWhole;
  wire::Status status = wire::Status::kOk;  ///< The result of a whole or ended call.
  /// The call's number, from 1; all its records have it. Numbers ascend in a lane of one thread; a
  /// server with one such lane leaves none out.
  std::uint64_t number = 0;
  std::uint32_t service = 0;  ///< The object's number, as bound: the index in objects(), plus 1.
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t session = 0;
  std::uint64_t trace_id = 0;
  MonotonicTime received{};
  /// When the method had ended, or the item was sent. For a call that begins, when the method
  /// returned.
  MonotonicTime finished{};
  std::uint32_t request_size = 0;  ///< Also where the payload was left out.
  std::uint32_t reply_size = 0;
  ConstBytes request{};  ///< Empty if it was left out.
  ConstBytes reply{};
};

/// A tap's losses since it was switched on.
struct TapLosses {
  std::uint64_t dropped_count = 0;  ///< Records that found the ring full, or all rings in use.
  std::uint64_t omitted_payload_count = 0;  ///< Payloads that were too long.
};

/// The tap of a server: while it is on, each lane copies its calls into rings of its own, from
/// which one thread reads them. A lane never waits for it, allocates nothing and makes no system
/// call. The tap records calls that reached a method, also those within the program; refused calls
/// are in the server's counters.
/// @ownership may outlive its server, whose end switches it off for good
/// @threads  one at a time
/// @realtime none for its own methods; a lane's part is wait-free, alloc-free and without syscall,
///           and costs a load and a branch while the tap is off
class CallTap {
 public:
  CallTap() = default;
  CallTap(const CallTap&) = delete;
  CallTap& operator=(const CallTap&) = delete;
  virtual ~CallTap() = default;

  /// Allocates the rings; from now on the lanes record.
  /// @errors   it is on already; the server has stopped; no such object; a size out of range
  [[nodiscard]] virtual expected<void, SetupError> switch_on(const TapConfig& config) = 0;
  /// Frees the rings, after waiting at most a second for lanes that write there. Does nothing when
  /// off.
  virtual void switch_off() noexcept = 0;
  /// False also once the server has stopped.
  [[nodiscard]] virtual bool is_on() const noexcept = 0;
  /// The next record, valid until the next call; nothing while there is none.
  [[nodiscard]] virtual std::optional<TappedCall> next() noexcept = 0;
  [[nodiscard]] virtual TapLosses losses() noexcept = 0;
  /// The paths of the server's objects, as of switch_on().
  [[nodiscard]] virtual const std::vector<std::string>& objects() const noexcept = 0;
};

}  // namespace rtpm::rpc

#include "rtpm/device_falcon/start_up.hpp"

#include <algorithm>
#include <array>
#include <initializer_list>
#include <utility>
#include <vector>

#include "rtpm/device_falcon/protocol.hpp"

namespace rtpm::device_falcon {
namespace {

using std::chrono::milliseconds;

enum class Outcome : std::uint8_t {
  kOk,
  kGone,
  kStalled,
  kSilent,      ///< No packets arrived: no firmware is running.
  kBootSilent,  ///< The boot loader sends no greeting.
  kWrongEcho,   ///< The boot loader echoed other bytes than were sent.
};

constexpr int kPacketAttemptMax = 20;
constexpr Duration kPacketPatience = milliseconds{20};
constexpr Duration kGreetingPatience = milliseconds{50};
constexpr int kGreetingAttemptMax = 20;
constexpr Duration kEchoPatience = milliseconds{100};
constexpr Duration kDrainPatience = milliseconds{2};
/// The payload of one USB packet, so that an echo arrives in one packet.
constexpr std::size_t kBlockSize = kUsbPacketSize - kFtdiStatusSize;
/// Limits how long a device that sends endlessly is drained.
constexpr int kDrainMax = 50;

constexpr std::array kGreeting{std::byte{0x0a}, std::byte{0x43}, std::byte{0x0d}};
constexpr std::array kGreetingReply{std::byte{0x0a}, std::byte{0x44}, std::byte{0x2c},
                                    std::byte{0x0d}};
constexpr std::array kLoadPrompt{std::byte{0x41}};

struct Setting {
  FtdiRequest request;
  std::uint16_t value;
};

class StartUp {
 public:
  StartUp(Transport& transport, std::span<const std::byte> firmware)
      : transport_(transport), firmware_(firmware) {}

  /// Repeats everything after any failure, because failures may be transient, except if the unit is
  /// gone.
  [[nodiscard]] Outcome run() {
    Outcome outcome = begin_packets();
    for (int i = 0; i < kLoadAttemptMax; ++i) {
      if (outcome == Outcome::kOk || outcome == Outcome::kGone) break;
      outcome = firmware_.empty() ? Outcome::kOk : load();
      if (outcome == Outcome::kOk) outcome = begin_packets();
    }
    return outcome;
  }

 private:
  [[nodiscard]] Outcome set(std::initializer_list<Setting> settings) {
    for (const Setting& setting : settings) {
      switch (transport_.request(setting.request, setting.value)) {
        case UsbStatus::kOk:
          break;
        case UsbStatus::kGone:
          return Outcome::kGone;
        default:
          return Outcome::kStalled;
      }
    }
    return Outcome::kOk;
  }

  /// Discards bytes that have already arrived.
  [[nodiscard]] Outcome drain() {
    Received received{.status = UsbStatus::kOk};
    for (int i = 0; i < kDrainMax && received.status == UsbStatus::kOk; ++i) {
      received = transport_.receive(transfer_, kDrainPatience);
      // The chip sends only its status if it has no other data.
      if (received.size <= kFtdiStatusSize) break;
    }
    received_.clear();
    return received.status == UsbStatus::kGone ? Outcome::kGone : Outcome::kOk;
  }

  [[nodiscard]] Outcome send(std::span<const std::byte> bytes) {
    const MonotonicTime end = transport_.now() + kEchoPatience;
    while (transport_.now() < end) {
      const UsbStatus status = transport_.send(bytes);
      if (status == UsbStatus::kOk) return Outcome::kOk;
      if (status == UsbStatus::kGone) return Outcome::kGone;
      if (status != UsbStatus::kBusy) return Outcome::kStalled;
      if (const Outcome outcome = receive(milliseconds{1}); outcome != Outcome::kOk) return outcome;
    }
    return Outcome::kStalled;
  }

  /// Appends the received bytes of at most one transfer.
  [[nodiscard]] Outcome receive(Duration patience) {
    const Received received = transport_.receive(transfer_, patience);
    if (received.status == UsbStatus::kGone) return Outcome::kGone;
    if (received.status == UsbStatus::kStalled) return Outcome::kStalled;
    if (received.status != UsbStatus::kOk) return Outcome::kOk;
    const std::span<std::byte> bytes = std::span(transfer_).first(received.size);
    const std::size_t size = strip_status(bytes);
    if (received_.size() + size <= kTransferSize) {
      received_.insert(received_.end(), bytes.begin(),
                       bytes.begin() + static_cast<std::ptrdiff_t>(size));
    }
    return Outcome::kOk;
  }

  /// Receives until `is_enough` returns true; the result is `otherwise` if that takes too long.
  template <class IsEnough>
  [[nodiscard]] Outcome await(Duration patience, Outcome otherwise, IsEnough&& is_enough) {
    const MonotonicTime end = transport_.now() + patience;
    for (MonotonicTime now = transport_.now(); now < end; now = transport_.now()) {
      if (const Outcome outcome = receive(end - now); outcome != Outcome::kOk) return outcome;
      if (is_enough()) return Outcome::kOk;
    }
    return otherwise;
  }

  /// Switches to 1.5 Mbaud and sends packets until the firmware answers one.
  [[nodiscard]] Outcome begin_packets() {
    Outcome outcome = set({{FtdiRequest::kDataBits, kEightBitsNoParity},
                           {FtdiRequest::kFlowControl, kNoFlowControl},
                           {FtdiRequest::kLatencyTimer, 1},
                           {FtdiRequest::kBaudRate, kRunDivisor},
                           {FtdiRequest::kReset, kPurgeReceived},
                           {FtdiRequest::kReset, kPurgeTransmitted}});
    if (outcome == Outcome::kOk) outcome = drain();
    if (outcome != Outcome::kOk) return outcome;
    outcome = Outcome::kSilent;
    for (int i = 0; i < kPacketAttemptMax && outcome == Outcome::kSilent; ++i) {
      outcome = ask_for_packet();
    }
    return outcome;
  }

  [[nodiscard]] Outcome ask_for_packet() {
    const MotorRequest request{.flags = kHomingFlag | kRedLedFlag};
    received_.clear();
    if (const Outcome outcome = send(encode(request)); outcome != Outcome::kOk) return outcome;
    return await(kPacketPatience, Outcome::kSilent, [&] {
      bool is_answered = false;
      PacketParser parser;
      parser.push(received_, [&](const EncoderReport& report) {
        // A boot loader with half of the firmware echoes the request.
        const bool is_echo =
            report.counts == LegCounts{} && report.buttons == request.flags && report.homed == 0;
        is_answered = is_answered || !is_echo;
      });
      return is_answered;
    });
  }

  [[nodiscard]] Outcome load() {
    Outcome outcome = set({{FtdiRequest::kReset, kPurgeReceived},
                           {FtdiRequest::kReset, kPurgeTransmitted},
                           {FtdiRequest::kLatencyTimer, 16},
                           {FtdiRequest::kBaudRate, kBootDivisor},
                           {FtdiRequest::kDataBits, kEightBitsNoParity},
                           {FtdiRequest::kFlowControl, kNoFlowControl},
                           {FtdiRequest::kModemControl, kRtsLow},
                           {FtdiRequest::kModemControl, kDtrLow},
                           {FtdiRequest::kModemControl, kDtrHigh}});
    if (outcome == Outcome::kOk) outcome = drain();
    if (outcome == Outcome::kOk) outcome = greet();
    if (outcome == Outcome::kOk) {
      outcome =
          set({{FtdiRequest::kModemControl, kDtrLow}, {FtdiRequest::kBaudRate, kLoadDivisor}});
    }
    if (outcome == Outcome::kOk) outcome = send_echoed(kLoadPrompt);
    for (std::size_t begin = 0; begin < firmware_.size() && outcome == Outcome::kOk;
         begin += kBlockSize) {
      outcome =
          send_echoed(firmware_.subspan(begin, std::min(kBlockSize, firmware_.size() - begin)));
    }
    return outcome;
  }

  [[nodiscard]] Outcome greet() {
    Outcome outcome = Outcome::kBootSilent;
    for (int i = 0; i < kGreetingAttemptMax && outcome == Outcome::kBootSilent; ++i) {
      received_.clear();
      outcome = send(kGreeting);
      if (outcome != Outcome::kOk) break;
      // Some hosts receive a zero before the greeting.
      outcome = await(kGreetingPatience, Outcome::kBootSilent, [&] {
        return std::search(received_.begin(), received_.end(), kGreetingReply.begin(),
                           kGreetingReply.end()) != received_.end();
      });
    }
    return outcome;
  }

  [[nodiscard]] Outcome send_echoed(std::span<const std::byte> block) {
    received_.clear();
    if (const Outcome outcome = send(block); outcome != Outcome::kOk) return outcome;
    const Outcome outcome =
        await(kEchoPatience, Outcome::kWrongEcho, [&] { return received_.size() >= block.size(); });
    if (outcome != Outcome::kOk) return outcome;
    return std::ranges::equal(received_, block) ? Outcome::kOk : Outcome::kWrongEcho;
  }

  Transport& transport_;
  std::span<const std::byte> firmware_;
  std::array<std::byte, kTransferSize> transfer_{};
  std::vector<std::byte> received_{};
};

unexpected<SetupError> refusal(Outcome outcome, bool has_firmware) {
  const std::string again = "switch the Falcon's power off and on again, and try another USB port";
  switch (outcome) {
    case Outcome::kGone:
      return setup_error("the Falcon was unplugged while it started", "", "plug it in");
    case Outcome::kSilent:
      if (!has_firmware) {
        return setup_error("the Falcon has no firmware",
                           "it loses it with its power, and RTPM has none to give it",
                           "add 'firmware=FILE' to the device's arguments, a file that you have "
                           "from the maker's software");
      }
      return setup_error("the Falcon took the firmware, but does not run it",
                         "the file is perhaps no firmware of a Falcon", "give another file");
    case Outcome::kBootSilent:
      return setup_error("the Falcon's boot loader does not answer",
                         "its power is off, or it has hung", again);
    case Outcome::kWrongEcho:
      return setup_error("the firmware does not reach the Falcon",
                         "what it sends back is not what it was sent", again);
    default:
      return setup_error("the Falcon's USB chip refuses what it is told", "", again);
  }
}

}  // namespace

expected<void, SetupError> start_up(Transport& transport, std::span<const std::byte> firmware) {
  const Outcome outcome = StartUp(transport, firmware).run();
  if (outcome != Outcome::kOk) return refusal(outcome, !firmware.empty());
  return {};
}

}  // namespace rtpm::device_falcon

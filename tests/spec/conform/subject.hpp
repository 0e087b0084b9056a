#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/medium.hpp"

/// RTPM's client and server as programs under test of spec/conform, whose README.md describes the
/// lines that they read and write.
namespace rtpm::spec {

/// Splits `does call c1 payload=01` into {does, call, c1} and {payload: 01}.
struct Line {
  std::vector<std::string> words;
  std::map<std::string, std::string> values;

  [[nodiscard]] std::string word(std::size_t index) const;
  /// The value of `name`; "" if it is missing.
  [[nodiscard]] std::string value(const std::string& name) const;
  [[nodiscard]] std::uint64_t number(const std::string& name) const;
};
[[nodiscard]] Line parse_line(std::string_view text);

/// Writes a line to stdout at once.
void say(const std::string& line);

[[nodiscard]] std::vector<std::byte> bytes_of(const std::string& hex);
[[nodiscard]] std::string hex_of_bytes(ConstBytes bytes);
[[nodiscard]] sockaddr_in address_of(const std::string& host_and_port);
[[nodiscard]] std::string text_of(const sockaddr_in& address);
/// A random number other than 0.
[[nodiscard]] std::uint64_t random_number();

/// The subject's deliberate faults, which the tool has to find.
struct Faults {
  bool runs_copies = false;           ///< A server runs a copy of a call again.
  bool swaps_numbers = false;         ///< A server swaps call_id and service.
  bool states_no_budget = false;      ///< A client's budget_us is 0.
  bool shifts_cookie = false;         ///< A client writes the cookie 8 bytes too late.
  bool hides_address = false;         ///< A client hides its address until it is heard.
  bool hangs_on = false;              ///< A client stays connected where the stream is broken.
  bool repeats_rarely = false;        ///< A client does not repeat a call sooner than after 2 s.
  bool clears_flags = false;          ///< Either side ignores all flags but the first two.
  bool states_no_run_time = false;    ///< A server's budget_us in REPLY is 0.
  bool numbers_from_one = false;      ///< A client's first handshake number is 1.
  bool answers_every_cookie = false;  ///< A client answers each COOKIE with its HELLO.
  bool tells_no_gap = false;          ///< A client tells of gaps when it asks, not before.
};
/// Returns the frame that is read instead of `frame`.
[[nodiscard]] std::vector<std::byte> as_read(ConstBytes frame, const Faults& faults);
/// Returns the frame that is sent instead of `frame`.
[[nodiscard]] std::vector<std::byte> with_faults(ConstBytes frame, const Faults& faults);

/// Splits a stream of bytes into frames by the sizes in their headers. An invalid header comes with
/// all bytes behind it.
class FrameSplitter {
 public:
  explicit FrameSplitter(const Faults& faults = {}) : faults_(faults) {}
  void add(ConstBytes bytes);
  /// The next whole frame; empty if there is none.
  [[nodiscard]] std::vector<std::byte> next();

 private:
  Faults faults_;
  std::vector<std::byte> rest_;
};

/// One side of the protocol between sockets and lines.
class Side {
 public:
  Side() = default;
  Side(const Side&) = delete;
  Side& operator=(const Side&) = delete;
  virtual ~Side() = default;
  [[nodiscard]] virtual std::vector<int> sockets() const = 0;
  virtual void on_readable(int socket) = 0;
  virtual void on_line(const Line& line) = 0;
  virtual void on_time() = 0;
  [[nodiscard]] virtual MonotonicTime next_time() const = 0;
};
/// Makes the side that the line `setup` describes; prints `ready`.
[[nodiscard]] std::unique_ptr<Side> make_server(const Line& setup, const Faults& faults);
[[nodiscard]] std::unique_ptr<Side> make_client(const Line& setup, const Faults& faults);
/// A client that manages sessions by itself (level=bindings). It has no faults to offer.
[[nodiscard]] std::unique_ptr<Side> make_binding(const Line& setup);

/// The medium named in a line `setup`.
[[nodiscard]] wire::Medium medium_of(const Line& setup);
/// Answers the line `counters`.
void say_counters(const wire::FrameCounters& counters);

}  // namespace rtpm::spec

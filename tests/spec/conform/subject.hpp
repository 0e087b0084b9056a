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

/// RTPM's client and server as programs under test of spec/conform, whose README.md has the lines
/// that they read and write.
namespace rtpm::spec {

/// `does call c1 payload=01` as {does, call, c1} and {payload: 01}.
struct Line {
  std::vector<std::string> words;
  std::map<std::string, std::string> values;

  [[nodiscard]] std::string word(std::size_t index) const;
  /// "" if it is not there.
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
[[nodiscard]] MonotonicTime monotonic_now();

/// Which fault the subject shall have, to see that the tool finds it.
struct Faults {
  bool runs_copies = false;       ///< A server runs a copy of a call again.
  bool swaps_numbers = false;     ///< A server writes call_id and service in each other's place.
  bool states_no_budget = false;  ///< A client's budget_us is 0.
  bool shifts_cookie = false;     ///< A client writes the cookie 8 bytes too late.
  bool hides_address = false;     ///< A client does not tell its address before it is heard.
  bool hangs_on = false;          ///< A client stays connected where the stream is broken.
  bool repeats_rarely = false;    ///< A client does not repeat a call sooner than after 2 s.
  bool clears_flags = false;      ///< Either side looks at no flag but the first two.
};
/// What is taken instead of `frame`.
[[nodiscard]] std::vector<std::byte> as_read(ConstBytes frame, const Faults& faults);
/// What is sent instead of `frame`.
[[nodiscard]] std::vector<std::byte> with_faults(ConstBytes frame, const Faults& faults);

/// Frames out of a stream of bytes, by the sizes in their headers. A header that is none comes with
/// all that is behind it.
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
/// Set up by the line `setup`; says `ready`.
[[nodiscard]] std::unique_ptr<Side> make_server(const Line& setup, const Faults& faults);
[[nodiscard]] std::unique_ptr<Side> make_client(const Line& setup, const Faults& faults);
/// A client that looks after sessions by itself (level=bindings). It has no faults to offer.
[[nodiscard]] std::unique_ptr<Side> make_binding(const Line& setup);

/// The medium that a line `setup` names.
[[nodiscard]] wire::Medium medium_of(const Line& setup);
/// Answers the line `counters`.
void say_counters(const wire::FrameCounters& counters);

}  // namespace rtpm::spec

#include "subject.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <iostream>
#include <sstream>

#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/header.hpp"

namespace rtpm::spec {
namespace {

/// Reads lines such as `sees run` and `does call`, which end with a line feed.
class LineInput {
 public:
  /// Reads the available bytes; false at the end.
  bool read_more() {
    char buffer[65536];
    const ssize_t size = ::read(STDIN_FILENO, buffer, sizeof buffer);
    if (size > 0) rest_.append(buffer, static_cast<std::size_t>(size));
    return size > 0;
  }
  bool next(std::string& line) {
    const std::size_t end = rest_.find('\n');
    if (end == std::string::npos) return false;
    line = rest_.substr(0, end);
    rest_.erase(0, end + 1);
    return true;
  }

 private:
  std::string rest_;
};

int timeout_ms(MonotonicTime until) {
  if (until == kNever) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - rt::now()).count();
  return static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000));
}

std::unique_ptr<Side> make_side(const Line& setup, const Faults& faults) {
  if (setup.value("role") == "server") return make_server(setup, faults);
  if (setup.value("level") == "bindings") return make_binding(setup);
  return make_client(setup, faults);
}

int run(const Faults& faults) {
  LineInput input;
  std::unique_ptr<Side> side;
  while (true) {
    std::vector<pollfd> polled{{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0}};
    if (side) {
      for (const int socket : side->sockets())
        polled.push_back({.fd = socket, .events = POLLIN, .revents = 0});
    }
    ::poll(polled.data(), polled.size(), side ? timeout_ms(side->next_time()) : -1);
    for (std::size_t i = 1; i < polled.size(); ++i) {
      if (polled[i].revents != 0) side->on_readable(polled[i].fd);
    }
    if (side) side->on_time();
    if (polled[0].revents == 0) continue;
    if (!input.read_more()) return 0;
    for (std::string text; input.next(text);) {
      const Line line = parse_line(text);
      if (line.word(0) == "quit") return 0;
      if (line.word(0) == "setup") {
        side = make_side(line, faults);
      } else if (side) {
        side->on_line(line);
      }
    }
  }
}

}  // namespace

std::string Line::word(std::size_t index) const {
  return index < words.size() ? words[index] : std::string();
}

std::string Line::value(const std::string& name) const {
  const auto found = values.find(name);
  return found == values.end() ? std::string() : found->second;
}

std::uint64_t Line::number(const std::string& name) const {
  const std::string text = value(name);
  return text.empty() ? 0 : std::stoull(text, nullptr, 0);
}

Line parse_line(std::string_view text) {
  Line line;
  std::istringstream parts{std::string(text)};
  for (std::string part; parts >> part;) {
    const std::size_t equals = part.find('=');
    if (equals == std::string::npos) {
      line.words.push_back(part);
    } else {
      line.values[part.substr(0, equals)] = part.substr(equals + 1);
    }
  }
  return line;
}

void say(const std::string& line) {
  std::cout << line << std::endl;
}

std::vector<std::byte> bytes_of(const std::string& hex) {
  std::vector<std::byte> bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::byte>(std::stoul(hex.substr(2 * i, 2), nullptr, 16));
  return bytes;
}

std::string hex_of_bytes(ConstBytes bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  for (const std::byte byte : bytes) {
    hex += kDigits[std::to_integer<unsigned>(byte) >> 4];
    hex += kDigits[std::to_integer<unsigned>(byte) & 15];
  }
  return hex;
}

sockaddr_in address_of(const std::string& host_and_port) {
  const std::size_t colon = host_and_port.rfind(':');
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoul(host_and_port.substr(colon + 1))));
  ::inet_pton(AF_INET, host_and_port.substr(0, colon).c_str(), &address.sin_addr);
  return address;
}

std::string text_of(const sockaddr_in& address) {
  char host[INET_ADDRSTRLEN] = {};
  ::inet_ntop(AF_INET, &address.sin_addr, host, sizeof host);
  return std::string(host) + ":" + std::to_string(ntohs(address.sin_port));
}

std::uint64_t random_number() {
  std::uint64_t number = 0;
  while (number == 0) {
    if (::getentropy(&number, sizeof number) != 0) return 1;
  }
  return number;
}

std::vector<std::byte> as_read(ConstBytes frame, const Faults& faults) {
  std::vector<std::byte> read(frame.begin(), frame.end());
  if (faults.clears_flags && read.size() >= wire::kHeaderSize) {
    read[6] &= std::byte{3};
    read[7] = std::byte{0};
  }
  return read;
}

std::vector<std::byte> with_faults(ConstBytes frame, const Faults& faults) {
  std::vector<std::byte> sent(frame.begin(), frame.end());
  if (sent.size() < wire::kHeaderSize) return sent;
  const auto kind = static_cast<wire::FrameKind>(sent[3]);
  const auto at = [&sent](std::size_t offset) {
    return sent.begin() + static_cast<std::ptrdiff_t>(offset);
  };
  if (faults.swaps_numbers && kind == wire::FrameKind::kReply)
    std::swap_ranges(at(16), at(20), at(20));
  if (faults.states_no_budget && kind == wire::FrameKind::kCall)
    std::fill(at(40), at(44), std::byte{0});
  if (faults.states_no_run_time && kind == wire::FrameKind::kReply)
    std::fill(at(40), at(44), std::byte{0});
  if (faults.shifts_cookie && kind == wire::FrameKind::kHello) {
    std::copy_backward(at(104), at(120), at(128));
    std::fill(at(104), at(112), std::byte{0});
  }
  return sent;
}

void FrameSplitter::add(ConstBytes bytes) {
  rest_.insert(rest_.end(), bytes.begin(), bytes.end());
}

std::vector<std::byte> FrameSplitter::next() {
  if (rest_.size() < wire::kHeaderSize) return {};
  const auto header = wire::decode(as_read(rest_, faults_));
  std::size_t size = rest_.size();
  if (header) size = wire::kHeaderSize + header->payload_size;
  if (header && size > wire::kStreamFrameSizeMax) size = wire::kHeaderSize;
  if (rest_.size() < size) return {};
  const auto end = rest_.begin() + static_cast<std::ptrdiff_t>(size);
  std::vector<std::byte> frame(rest_.begin(), end);
  rest_.erase(rest_.begin(), end);
  return frame;
}

wire::Medium medium_of(const Line& setup) {
  return setup.value("medium") == "stream" ? wire::Medium::kStream : wire::Medium::kDatagram;
}

void say_counters(const wire::FrameCounters& counters) {
  std::string line = "counters";
  for (std::size_t i = 0; i < wire::kDropReasonCount; ++i) {
    const std::uint64_t count = counters.dropped[i];
    if (count == 0) continue;
    line += ' ' + std::string(to_string(static_cast<wire::DropReason>(i))) + '=' +
            std::to_string(count);
  }
  say(line);
}

}  // namespace rtpm::spec

int main(int argument_count, char** arguments) {
  using rtpm::spec::Faults;
  const std::map<std::string_view, bool Faults::*> flags{
      {"--runs-copies", &Faults::runs_copies},
      {"--swaps-numbers", &Faults::swaps_numbers},
      {"--states-no-budget", &Faults::states_no_budget},
      {"--shifts-cookie", &Faults::shifts_cookie},
      {"--hides-address", &Faults::hides_address},
      {"--hangs-on", &Faults::hangs_on},
      {"--repeats-rarely", &Faults::repeats_rarely},
      {"--clears-flags", &Faults::clears_flags},
      {"--states-no-run-time", &Faults::states_no_run_time},
      {"--numbers-from-one", &Faults::numbers_from_one},
      {"--answers-every-cookie", &Faults::answers_every_cookie},
      {"--tells-no-gap", &Faults::tells_no_gap}};
  Faults faults;
  for (int i = 1; i < argument_count; ++i) {
    const auto flag = flags.find(arguments[i]);
    if (flag == flags.end()) {
      std::cerr << "conform_subject: no such fault: " << arguments[i] << '\n';
      return 2;
    }
    faults.*flag->second = true;
  }
  return rtpm::spec::run(faults);
}

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"

/// Captures of traffic that was never on a network, and the output of tshark for them.
namespace rtpm::spec {

/// One end of a datagram or connection: an IPv4 address in the test network 192.0.2.0/24.
struct End {
  std::uint8_t host = 1;
  std::uint16_t port = 0;
};

/// Collects packets and writes them as a file of the pcap format (with nanoseconds, raw IP).
class Capture {
 public:
  void add_datagram(End from, End to, ConstBytes payload, MonotonicTime when);
  /// The next bytes of the connection in this direction.
  void add_segment(End from, End to, ConstBytes payload, MonotonicTime when);
  /// The number of packets, which is the last one's number in Wireshark.
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  void write(const std::string& path) const;

 private:
  void add_packet(End from, End to, std::uint8_t protocol, ConstBytes content, MonotonicTime when);

  std::vector<std::byte> records_;
  std::size_t count_ = 0;
  std::map<std::uint64_t, std::uint32_t> next_sequence_;  ///< The next number by direction.
};

/// The values of the requested fields, of one packet. A repeated field has its values separated by
/// commas; a missing one is "".
using Row = std::map<std::string, std::string>;

/// Why tshark can't be used here; "" if it can.
[[nodiscard]] std::string why_no_tshark();

/// Runs tshark with spec/wireshark/hprotocol.lua over `capture`; one row for each packet. Any other
/// output of tshark on its standard error, except its warning of root, fails the test.
/// @param key_log  the text of the file that the preference `key_log` names
[[nodiscard]] std::vector<Row> dissect(const Capture& capture,
                                       const std::vector<std::string>& fields,
                                       const std::string& key_log = "");

}  // namespace rtpm::spec

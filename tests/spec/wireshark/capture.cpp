#include "capture.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::spec {
namespace {

constexpr std::uint8_t kTcp = 6;
constexpr std::uint8_t kUdp = 17;
constexpr std::uint32_t kPcapMagicNanoseconds = 0xa1b23c4d;
constexpr std::uint32_t kPcapRawIp = 101;

/// Numbers on a network are big-endian.
void put_u8(std::vector<std::byte>& to, std::uint8_t value) {
  to.push_back(static_cast<std::byte>(value));
}
void put_u16(std::vector<std::byte>& to, std::size_t value) {
  put_u8(to, static_cast<std::uint8_t>(value >> 8));
  put_u8(to, static_cast<std::uint8_t>(value & 0xff));
}
void put_u32(std::vector<std::byte>& to, std::uint32_t value) {
  put_u16(to, value >> 16);
  put_u16(to, value & 0xffff);
}
void put_address(std::vector<std::byte>& to, End end) {
  put_u32(to, 0xc0000200u | end.host);
}
void put_bytes(std::vector<std::byte>& to, ConstBytes bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// The numbers of a pcap file are little-endian here.
template <class T>
void put_le(std::vector<std::byte>& to, T value) {
  std::array<std::byte, sizeof(T)> bytes{};
  store_le(bytes.data(), value);
  put_bytes(to, bytes);
}

std::uint64_t direction(End from, End to) {
  return std::uint64_t{from.host} << 40 | std::uint64_t{from.port} << 24 |
         std::uint64_t{to.host} << 16 | to.port;
}

/// Splits `line` at its tabs.
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char character : line) {
    if (character == '\t') {
      cells.emplace_back();
    } else {
      cells.back() += character;
    }
  }
  return cells;
}

/// Returns the text without the warning not to run as root.
std::string complaints_in(const std::string& text) {
  std::istringstream lines(text);
  std::string complaints;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("Running as user")) complaints += line + '\n';
  }
  return complaints;
}

}  // namespace

void Capture::add_packet(End from, End to, std::uint8_t protocol, ConstBytes content,
                         MonotonicTime when) {
  constexpr std::size_t kIpHeaderSize = 20;
  std::vector<std::byte> packet;
  put_u16(packet, 0x4500);  // Version 4, five words of header.
  put_u16(packet, kIpHeaderSize + content.size());
  put_u32(packet, 0x00004000);  // Must not be fragmented.
  put_u8(packet, 64);
  put_u8(packet, protocol);
  put_u16(packet, 0);  // No checksum, as if the network card made it.
  put_address(packet, from);
  put_address(packet, to);
  put_bytes(packet, content);

  const auto ns = static_cast<std::uint64_t>(to_ns(when));
  put_le(records_, static_cast<std::uint32_t>(ns / 1'000'000'000));
  put_le(records_, static_cast<std::uint32_t>(ns % 1'000'000'000));
  put_le(records_, static_cast<std::uint32_t>(packet.size()));
  put_le(records_, static_cast<std::uint32_t>(packet.size()));
  put_bytes(records_, packet);
  ++count_;
}

void Capture::add_datagram(End from, End to, ConstBytes payload, MonotonicTime when) {
  constexpr std::size_t kUdpHeaderSize = 8;
  std::vector<std::byte> content;
  put_u16(content, from.port);
  put_u16(content, to.port);
  put_u16(content, kUdpHeaderSize + payload.size());
  put_u16(content, 0);
  put_bytes(content, payload);
  add_packet(from, to, kUdp, content, when);
}

void Capture::add_segment(End from, End to, ConstBytes payload, MonotonicTime when) {
  std::uint32_t& sequence = next_sequence_.try_emplace(direction(from, to), 1).first->second;
  const std::uint32_t acknowledged =
      next_sequence_.try_emplace(direction(to, from), 1).first->second;
  std::vector<std::byte> content;
  put_u16(content, from.port);
  put_u16(content, to.port);
  put_u32(content, sequence);
  put_u32(content, acknowledged);
  put_u16(content, 0x5018);  // Five words of header; PSH and ACK.
  put_u16(content, 0xffff);
  put_u32(content, 0);
  put_bytes(content, payload);
  sequence += static_cast<std::uint32_t>(payload.size());
  add_packet(from, to, kTcp, content, when);
}

void Capture::write(const std::string& path) const {
  std::vector<std::byte> head;
  put_le(head, kPcapMagicNanoseconds);
  put_le(head, std::uint16_t{2});
  put_le(head, std::uint16_t{4});
  put_le(head, std::uint64_t{0});
  put_le(head, std::uint32_t{0xffff});
  put_le(head, kPcapRawIp);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(head.data()), std::ssize(head));
  file.write(reinterpret_cast<const char*>(records_.data()), std::ssize(records_));
  EXPECT_TRUE(file.good()) << path;
}

std::string why_no_tshark() {
  const test::TemporaryFolder folder;
  const std::string command = "tshark --version >" + folder.file("version") + " 2>/dev/null";
  if (std::system(command.c_str()) != 0) return "needs tshark (Debian package tshark)";
  const std::string version = folder.read("version");
  return version.find("with Lua") == std::string::npos ? "needs a tshark that was built with Lua"
                                                       : "";
}

std::vector<Row> dissect(const Capture& capture, const std::vector<std::string>& fields,
                         const std::string& key_log) {
  const test::TemporaryFolder folder;
  capture.write(folder.file("capture.pcap"));
  // tshark gets its own home, so that no user's settings and scripts interfere.
  std::string command = "HOME='" + folder.file("") + "' XDG_CONFIG_HOME='" + folder.file("") +
                        "' tshark -2 -n -X 'lua_script:" RTPM_SPEC_DIR
                        "/wireshark/hprotocol.lua' -r '" +
                        folder.file("capture.pcap") + "' -T fields";
  if (!key_log.empty()) {
    std::ofstream(folder.file("keys")) << key_log;
    command += " -o 'rtpm.key_log:" + folder.file("keys") + "'";
  }
  for (const std::string& field : fields)
    command += " -e " + field;
  command += " 2>'" + folder.file("errors") + "' >'" + folder.file("rows") + "'";
  const int status = std::system(command.c_str());
  EXPECT_EQ(status, 0) << command;
  EXPECT_EQ(complaints_in(folder.read("errors")), "");

  std::vector<Row> rows;
  std::ifstream file(folder.file("rows"));
  for (std::string line; std::getline(file, line);) {
    const std::vector<std::string> cells = cells_of(line);
    EXPECT_EQ(cells.size(), fields.size()) << line;
    Row row;
    for (std::size_t i = 0; i < fields.size() && i < cells.size(); ++i)
      row[fields[i]] = cells[i];
    rows.push_back(row);
  }
  EXPECT_EQ(rows.size(), capture.count());
  return rows;
}

}  // namespace rtpm::spec

// spec/layouts.json against RTPM's code: the code writes and reads each field at the offset that
// the pages state. The vectors show it for the layouts of frames, as their generator has those of the
// pages, too.

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "broadcast/multicast.hpp"
#include "rtpm/discovery/datagram.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/link.hpp"

namespace rtpm::spec {
namespace {

using Json = nlohmann::json;
using Bytes = std::vector<std::byte>;
using Values = std::map<std::string, std::uint64_t>;

Json layout_named(const std::string& name) {
  std::ifstream file(RTPM_SPEC_DIR "/layouts.json");
  const Json document = Json::parse(file);
  for (const Json& layout : document.at("layouts")) {
    if (layout.at("name") == name) return layout;
  }
  ADD_FAILURE() << "spec/layouts.json has no " << name;
  return {};
}

/// The number at a field's offset, up to 8 bytes.
std::uint64_t number_at(const Bytes& bytes, const Json& field) {
  const std::size_t offset = field.at("offset");
  const std::size_t size = std::min(field.at("size").get<std::size_t>(), std::size_t{8});
  std::uint64_t number = 0;
  for (std::size_t i = size; i > 0; --i)
    number = number << 8 | std::to_integer<std::uint64_t>(bytes.at(offset + i - 1));
  return number;
}

/// Each field of the layout has its value, and `values` has no other; reserved ones have 0.
void expect_layout(const std::string& name, const Bytes& bytes, Values values) {
  SCOPED_TRACE(name);
  const Json layout = layout_named(name);
  if (!layout.at("size").is_null()) {
    EXPECT_EQ(layout.at("size"), bytes.size());
  }
  for (const Json& field : layout.at("fields")) {
    const std::string field_name = field.at("field");
    if (field.at("size").is_null()) continue;
    const bool is_reserved = field_name == "reserved";
    ASSERT_TRUE(is_reserved || values.contains(field_name)) << "no value for " << field_name;
    EXPECT_EQ(number_at(bytes, field), is_reserved ? 0 : values.at(field_name)) << field_name;
  }
  for (const Json& field : layout.at("fields"))
    values.erase(field.at("field"));
  EXPECT_TRUE(values.empty()) << "the layout has no field " << values.begin()->first;
}

/// Bytes with each field at its offset in the layout.
Bytes laid_out(const std::string& name, const Values& values, std::size_t size) {
  Bytes bytes(size);
  const Json layout = layout_named(name);
  for (const Json& field : layout.at("fields")) {
    const auto found = values.find(field.at("field"));
    if (found == values.end()) continue;
    for (std::size_t i = 0; i < std::min(field.at("size").get<std::size_t>(), std::size_t{8}); ++i)
      bytes[field.at("offset").get<std::size_t>() + i] =
          static_cast<std::byte>(found->second >> (8 * i));
  }
  return bytes;
}

TEST(Layouts, Event) {
  events::EventHeader header;
  header.type = 0x01020304;
  header.source = 0x11121314;
  header.sequence = 0x2122232425262728;
  header.origin = time_from_ns(0x3132333435363738);
  header.hub_received = time_from_ns(0x4142434445464748);
  header.hub_sent = time_from_ns(0x5152535455565758);
  header.schema_id = 0x6162636465666768;
  header.origin_uncertainty_ns = 0x71727374;
  header.priority = 0x0123;
  header.hops_left = 7;
  header.is_replayed = header.is_continued = true;
  header.supplier_tag = 0x81828384;
  Bytes memory(128);
  events::EventWriter writer(memory);
  const Bytes payload(3, std::byte{0xff});
  ASSERT_TRUE(writer.put(header, payload));
  expect_layout("event", memory,
                {{"type", header.type},
                 {"source", header.source},
                 {"sequence", header.sequence},
                 {"origin_ns", 0x3132333435363738},
                 {"hub_received_ns", 0x4142434445464748},
                 {"hub_sent_ns", 0x5152535455565758},
                 {"schema_id", header.schema_id},
                 {"payload_size", 3},
                 {"origin_uncertainty_ns", header.origin_uncertainty_ns},
                 {"priority", 0x0123},
                 {"hops_left", 7},
                 {"flags", 3},
                 {"supplier_tag", header.supplier_tag},
                 {"payload", 0}});
  const auto read = events::EventReader(writer.bytes()).next();
  ASSERT_TRUE(read);
  EXPECT_EQ(read->header, header);
  EXPECT_EQ(read->payload.size(), payload.size());
}

TEST(Layouts, DiscoveryDatagram) {
  const auto datagram = discovery::decode(laid_out("discovery datagram",
                                                   {{"magic", 0x44505452},
                                                    {"version", 1},
                                                    {"kind", 1},
                                                    {"domain", 7},
                                                    {"number", 0x1112131415161718}},
                                                   discovery::kDatagramSize));
  ASSERT_TRUE(datagram);
  EXPECT_EQ(datagram->domain, 7);
  EXPECT_EQ(datagram->number, 0x1112131415161718U);
}

TEST(Layouts, LinkReport) {
  const auto report = events::read_link_report(
      laid_out("news of a link",
               {{"state", 2}, {"flags", 1}, {"gap_ns", 0x1112131415161718}, {"lost", 0x21222324}},
               events::kLinkReportSize));
  ASSERT_TRUE(report);
  EXPECT_EQ(static_cast<int>(report->state), 2);
  EXPECT_TRUE(report->has_peer_restarted);
  EXPECT_EQ(report->gap.count(), 0x1112131415161718);
  EXPECT_EQ(report->lost_count, 0x21222324U);
}

TEST(Layouts, MulticastDatagram) {
  const Bytes bytes = laid_out("multicast datagram",
                               {{"magic", 0x56455452},
                                {"version", 1},
                                {"id", 0x1112131415161718},
                                {"sequence", 0x2122232425262728},
                                {"record_size", 0x100},
                                {"offset", 0x80}},
                               events::kMulticastHeaderSize + 8);
  const auto datagram = events::read_multicast(bytes);
  ASSERT_TRUE(datagram);
  EXPECT_EQ(datagram->header,
            (events::MulticastHeader{0x1112131415161718, 0x2122232425262728, 0x100, 0x80, 0}));
  EXPECT_EQ(datagram->bytes.size(), 8U);
}

}  // namespace
}  // namespace rtpm::spec

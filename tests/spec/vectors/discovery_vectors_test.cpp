#include <gtest/gtest.h>

#include <array>

#include "rtpm/discovery/datagram.hpp"
#include "vectors.hpp"

namespace rtpm::spec {
namespace {

// hp-10.1-1
TEST(DiscoveryVectors, GoodOnesRoundTrip) {
  const Json vectors = read_vectors("discovery.json").at("good");
  EXPECT_FALSE(vectors.empty());
  for (const Json& vector : vectors) {
    SCOPED_TRACE(vector.at("name").get<std::string>());
    const auto read = discovery::decode(bytes_of_hex(vector.at("hex")));
    ASSERT_TRUE(read);
    EXPECT_EQ(read->is_answer, vector.at("kind") == "answer");
    EXPECT_EQ(read->domain, vector.at("domain"));
    EXPECT_EQ(read->number, wide_number(vector.at("number")));
    ASSERT_EQ(read->services.size(), vector.at("services").size());
    for (std::size_t i = 0; i < read->services.size(); ++i) {
      const Json& service = vector.at("services")[i];
      EXPECT_EQ(read->services[i].port, service.at("port"));
      EXPECT_EQ(read->services[i].is_registry, service.at("is_registry"));
      EXPECT_EQ(read->services[i].process_id, service.at("process_id"));
    }
    EXPECT_EQ(hex_of(discovery::encode(*read)), vector.at("hex"));
  }
}

// hp-10.1-2
TEST(DiscoveryVectors, BadOnesAreDropped) {
  const Json vectors = read_vectors("discovery.json").at("bad");
  EXPECT_FALSE(vectors.empty());
  for (const Json& vector : vectors)
    EXPECT_FALSE(discovery::decode(bytes_of_hex(vector.at("hex")))) << vector.at("name");
}

// Any bytes are read within their bounds, and written as they were.
TEST(DiscoveryVectors, AnyBytesAreReadWithinBounds) {
  const Bytes good = bytes_of_hex(read_vectors("discovery.json").at("good").back().at("hex"));
  std::uint64_t random = 1;
  for (int i = 0; i < 20'000; ++i) {
    Bytes bytes = good;
    for (int change = 0; change < 1 + i % 4; ++change) {
      random = random * 6364136223846793005 + 1442695040888963407;
      bytes[(random >> 33) % bytes.size()] = static_cast<std::byte>(random >> 57);
    }
    bytes.resize(i % 7 == 0 ? (random >> 40) % 300 : bytes.size());
    const auto read = discovery::decode(bytes);
    if (!read) continue;
    ASSERT_EQ(hex_of(discovery::encode(*read)), hex_of(bytes));
  }
}

}  // namespace
}  // namespace rtpm::spec

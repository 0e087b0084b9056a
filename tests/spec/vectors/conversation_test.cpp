#include "conversation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

// spec/vectors/conversations/: our client and our server each follow the vectors.
namespace rtpm::spec {
namespace {

struct Part {
  std::string conversation;
  Role role = Role::kClient;
};

void PrintTo(const Part& part, std::ostream* out) {
  *out << part.conversation;
}

Json read(const std::string& name) {
  return read_vectors("conversations/" + name + ".json");
}

std::vector<Part> all_parts() {
  std::vector<Part> parts;
  for (const std::string& name : conversation_names()) {
    const Json conversation = read(name);
    // The tests of spec/conform play these conversations.
    if (conversation.contains("level")) continue;
    for (const std::string role : conversation.at("roles")) {
      parts.push_back({name, role == "client" ? Role::kClient : Role::kServer});
    }
  }
  return parts;
}

class Conversations : public testing::TestWithParam<Part> {};

TEST_P(Conversations, FollowTheVector) {
  const Json conversation = read(GetParam().conversation);
  EXPECT_FALSE(conversation.at("steps").empty());
  EXPECT_EQ(play(conversation, GetParam().role), "");
}

INSTANTIATE_TEST_SUITE_P(Vectors, Conversations, testing::ValuesIn(all_parts()),
                         [](const testing::TestParamInfo<Part>& part) {
                           std::string name = part.param.conversation;
                           std::ranges::replace(name, '-', '_');
                           return name +
                                  (part.param.role == Role::kClient ? "_as_client" : "_as_server");
                         });

// A blind player would accept everything: each of these is a lie about our code.
class ConversationPlayer : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Vectors, ConversationPlayer,
                         testing::Values("lost-call", "large-request", "large-reply", "oneways",
                                         "cancelled-call", "stream", "several-calls",
                                         "server-stops"));

TEST_P(ConversationPlayer, DetectsDeviationsFromTheVector) {
  const Json good = read(GetParam());
  for (const Role role : {Role::kClient, Role::kServer}) {
    for (std::size_t i = 0; i < good.at("steps").size(); ++i) {
      const Json& step = good.at("steps")[i];
      const std::string self = role == Role::kClient ? "client" : "server";
      const bool is_output =
          step.value("frame", "").starts_with(self) || step.contains(self + "_sees");
      if (!is_output) continue;
      SCOPED_TRACE(self + ", step " + std::to_string(i));
      Json missing = good;
      missing.at("steps").erase(i);
      EXPECT_NE(play(missing, role), "");
      Json twice = good;
      twice.at("steps").insert(twice.at("steps").begin() + static_cast<std::ptrdiff_t>(i), step);
      EXPECT_NE(play(twice, role), "");
      if (!step.contains("hex")) continue;
      Json other = good;
      std::string hex = step.at("hex");
      hex[0] = '5';
      other.at("steps")[i]["hex"] = hex;
      EXPECT_NE(play(other, role), "");
    }
  }
}

/// Collects every value of `key` in a document.
void collect(const Json& document, const std::string& key, std::set<std::string>& values) {
  for (const auto& [name, value] : document.items()) {
    if (document.is_object() && name == key && value.is_string()) values.insert(value);
    if (value.is_structured()) collect(value, key, values);
  }
}

TEST(Vectors, HaveEveryKindStatusAndReason) {
  std::set<std::string> kinds, statuses, reasons;
  std::vector<Json> documents;
  for (const char* name : {"headers-good.json", "headers-bad.json", "hello.json", "cookie.json",
                           "welcome.json", "bind-request.json", "bind-reply.json", "sealed.json"}) {
    documents.push_back(read_vectors(name));
  }
  for (const std::string& name : conversation_names())
    documents.push_back(read(name));
  for (const Json& document : documents) {
    collect(document, "kind", kinds);
    collect(document, "status", statuses);
    collect(document, "drop", reasons);
    collect(document, "client_counts", reasons);
    collect(document, "server_counts", reasons);
  }
  for (std::size_t i = 1; i <= wire::kFrameKindLast; ++i) {
    EXPECT_TRUE(kinds.contains(std::string(to_string(static_cast<wire::FrameKind>(i))))) << i;
  }
  for (std::size_t i = 0; i < wire::kStatusCount; ++i) {
    EXPECT_TRUE(statuses.contains(std::string(to_string(static_cast<wire::Status>(i))))) << i;
  }
  // Each server decides how many are answered (hp-4.4-5).
  reasons.insert(std::string(to_string(wire::DropReason::kRateLimited)));
  for (std::size_t i = 0; i < wire::kDropReasonCount; ++i) {
    EXPECT_TRUE(reasons.contains(std::string(to_string(static_cast<wire::DropReason>(i))))) << i;
  }
}

}  // namespace
}  // namespace rtpm::spec

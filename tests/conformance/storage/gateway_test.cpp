#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "address.hpp"
#include "base64.hpp"
#include "fake_etcd.hpp"
#include "rtpm/etcd_store/etcd_storage.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/text.hpp"
#include "stored_value.hpp"

// Answers that no healthy etcd gives.
namespace rtpm::storage_test {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::expect_text;
using Kind = names::StorageError::Kind;

constexpr const char* kEmpty = R"({"header":{"cluster_id":"7","revision":"5"}})";

std::unique_ptr<names::Storage> storage_at(const std::string& endpoints) {
  auto storage = etcd_store::make_etcd_storage("etcd://" + endpoints);
  EXPECT_TRUE(storage) << storage.error().text();
  return std::move(*storage);
}

/// The reason why the answer is refused.
std::string refusal_of(const std::string& answer) {
  const FakeEtcd fake([&](const std::string&, const std::string&) { return answer; });
  const auto content = storage_at(fake.endpoint())->load();
  EXPECT_FALSE(content);
  return content ? std::string() : content.error().text();
}

names::StoredName stored() {
  return {.name = "lab/arm0",
          .url = "rtpm://10.0.0.1:1/p",
          .interface = "lab.Arm",
          .owner = {7, 1},
          .revision = 6,
          .change = 6};
}

/// Binds a name at these endpoints.
expected<std::uint64_t, names::StorageError> bind_at(names::Storage& storage,
                                                     Duration patience = 1s) {
  const names::StoredName name = stored();
  return storage.commit({name.name, &name, 6, true, 0, rt::now() + patience});
}

TEST(StoredValue, MapsALoopbackAddressToTheHostOfItsRegistry) {
  etcd_store::StoredValue value{{.url = "rtpm://127.0.0.1:4711/x", .host = 0x7f00'0001}, 1};
  EXPECT_EQ(etcd_store::parse_value(to_text(value))->stored.host, 0x7f00'0001U);
  value.where += 1;
  EXPECT_EQ(etcd_store::parse_value(to_text(value))->stored.host, names::kLoopbackElsewhere);
  value.stored.host = 0x0a00'0001;
  EXPECT_EQ(etcd_store::parse_value(to_text(value))->stored.host, 0x0a00'0001U);
}

TEST(Gateway, RefusesAnswersThatEtcdDoesNotGive) {
  const std::string no_json = "no JSON of etcd";
  for (const std::string& answer :
       std::vector<std::string>{"not json", "[]", "{}", "{\"header\":5}", "{\"result\":7}",
                                "\x01\xff{", std::string(100'000, '[')}) {
    const std::string text = refusal_of(answer);
    expect_text(text, {no_json, "127.0.0.1", "Remedy"});
    EXPECT_LT(text.size(), 500u);
  }
  const std::string key = etcd_store::to_base64("elsewhere/lab");
  for (const std::string& kvs :
       {std::string(R"([{"key":")") + key + R"(","mod_revision":"3"}])", std::string("[7]"),
        std::string(R"([{"key":"%%%","mod_revision":"3"}])"), std::string(R"({"a":"b"})")}) {
    expect_text(refusal_of(R"({"header":{"cluster_id":"7","revision":"5"},"kvs":)" + kvs + "}"),
                {"keys that were not asked for"});
  }
  expect_text(refusal_of(std::string(std::size_t{33} * 1024 * 1024, ' ')), {"more than 32 MiB"});
}

TEST(Gateway, SkipsValuesThatAreNotNames) {
  const std::string good = etcd_store::to_text({stored(), 1});
  json kvs = json::array();
  std::uint64_t revision = 1;
  for (const std::string& value : std::vector<std::string>{
           good, "", "7", "{}", "{\"version\":2}", good.substr(0, good.size() / 2),
           "{\"version\":1,\"owner\":[1,2],\"host\":-1}"}) {
    kvs.push_back({{"key", etcd_store::to_base64("rtpm/names/n" + std::to_string(revision))},
                   {"value", etcd_store::to_base64(value)},
                   {"mod_revision", std::to_string(revision)}});
    ++revision;
  }
  const json answer{{"header", {{"cluster_id", "7"}, {"revision", "9"}}}, {"kvs", kvs}};
  const FakeEtcd fake([&](const std::string&, const std::string&) { return answer.dump(); });
  const auto content = storage_at(fake.endpoint())->load();
  ASSERT_TRUE(content) << content.error().text();
  ASSERT_EQ(content->names.size(), 1u);
  EXPECT_EQ(content->names[0].name, "n1");
  EXPECT_EQ(content->names[0].url, stored().url);
  EXPECT_EQ(content->first_revision, 10u);
  ASSERT_EQ(content->faults.size(), 1u);
  expect_text(content->faults[0], {"6 values", "no names"});
}

TEST(Gateway, RefusesAnswersOfAnotherCluster) {
  bool is_gone = false;
  const FakeEtcd own([&](const std::string& path, const std::string&) -> std::string {
    return is_gone                  ? R"({"error":"etcdserver: no leader","code":14})"
           : path == "/v3/kv/range" ? kEmpty
                                    : "";
  });
  const FakeEtcd other([](const std::string&, const std::string&) {
    return R"({"header":{"cluster_id":"8","revision":"90"},"succeeded":true})";
  });
  const auto storage = storage_at(own.endpoint() + "," + other.endpoint());
  ASSERT_TRUE(storage->load());
  is_gone = true;
  const auto bound = bind_at(*storage);
  ASSERT_FALSE(bound);
  EXPECT_EQ(bound.error().kind, Kind::kUnreachable);
  expect_text(bound.error().text(),
              {"another cluster", "no leader", own.endpoint(), other.endpoint(), "Remedy"});
}

TEST(Gateway, RecognizesItsOwnChangeAfterALostAnswer) {
  std::mutex mutex;
  std::string done;
  const auto value_of = [](const std::string& body) {
    return json::parse(body)["success"][0]["request_put"]["value"].get<std::string>();
  };
  const FakeEtcd silent([&](const std::string& path, const std::string& body) -> std::string {
    if (path == "/v3/kv/range") return kEmpty;
    const std::lock_guard lock(mutex);
    done = value_of(body);
    return {};
  });
  const FakeEtcd next([&](const std::string&, const std::string&) {
    const std::lock_guard lock(mutex);
    const json found{{"key", etcd_store::to_base64("rtpm/names/lab/arm0")},
                     {"value", done},
                     {"mod_revision", "12"}};
    return json{{"header", {{"cluster_id", "7"}, {"revision", "20"}}},
                {"responses", {{{"response_range", {{"kvs", {found}}}}}}}}
        .dump();
  });
  const auto storage = storage_at(silent.endpoint() + "," + next.endpoint());
  ASSERT_TRUE(storage->load());
  const auto bound = bind_at(*storage);
  ASSERT_TRUE(bound) << bound.error().text();
  EXPECT_EQ(*bound, 12u);
  // Another registry's change is a conflict, which names the change.
  done = etcd_store::to_base64(etcd_store::to_text({stored(), 1}));
  const FakeEtcd others([&](const std::string& path, const std::string&) -> std::string {
    if (path == "/v3/kv/range") return kEmpty;
    const json found{{"key", etcd_store::to_base64("rtpm/names/lab/arm0")},
                     {"value", done},
                     {"mod_revision", "12"}};
    return json{{"header", {{"cluster_id", "7"}, {"revision", "20"}}},
                {"responses", {{{"response_range", {{"kvs", {found}}}}}}}}
        .dump();
  });
  const auto second = storage_at(others.endpoint());
  ASSERT_TRUE(second->load());
  const auto refused = bind_at(*second);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, Kind::kConflict);
}

TEST(Gateway, RecognizesItsOwnUnbindAfterALostAnswer) {
  std::mutex mutex;
  json fence;
  const FakeEtcd silent([&](const std::string& path, const std::string& body) -> std::string {
    if (path == "/v3/kv/range") return kEmpty;
    const std::lock_guard lock(mutex);
    fence = json::parse(body)["success"][1]["request_put"];
    fence["mod_revision"] = "12";
    return {};
  });
  const FakeEtcd next([&](const std::string&, const std::string&) {
    const std::lock_guard lock(mutex);
    return json{{"header", {{"cluster_id", "7"}, {"revision", "20"}}},
                {"responses",
                 {{{"response_range", json::object()}}, {{"response_range", {{"kvs", {fence}}}}}}}}
        .dump();
  });
  const auto storage = storage_at(silent.endpoint() + "," + next.endpoint());
  ASSERT_TRUE(storage->load());
  const auto unbind = [&] {
    return storage->commit({"lab/arm0", nullptr, 7, false, 6, rt::now() + 1s});
  };
  const auto unbound = unbind();
  ASSERT_TRUE(unbound) << unbound.error().text();
  EXPECT_EQ(*unbound, 12u);
  // The next unbind goes to the second endpoint only, and finds the fence of the first one.
  const auto refused = unbind();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, Kind::kConflict);
}

TEST(Gateway, ReportsAFullDiskAndAHungNode) {
  const FakeEtcd full([](const std::string& path, const std::string&) -> std::string {
    return path == "/v3/kv/range"
               ? kEmpty
               : R"({"error":"etcdserver: mvcc: database space exceeded","code":8})";
  });
  auto storage = storage_at(full.endpoint());
  ASSERT_TRUE(storage->load());
  const auto refused = bind_at(*storage);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, Kind::kFull);
  expect_text(refused.error().text(), {"space exceeded", "compact"});
  const FakeEtcd silent([](const std::string& path, const std::string&) -> std::string {
    return path == "/v3/kv/range" ? kEmpty : "";
  });
  storage = storage_at(silent.endpoint());
  ASSERT_TRUE(storage->load());
  const auto late = bind_at(*storage, 300ms);
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().kind, Kind::kUnreachable);
  expect_text(late.error().text(), {"does not answer in time", silent.endpoint()});
}

TEST(Gateway, AcceptsTheDocumentedAddresses) {
  const auto text_of = [](std::string_view url) {
    const auto address = etcd_store::parse_address(url);
    return address ? address->text() + " " + address->prefix : "refused: " + address.error().text();
  };
  EXPECT_EQ(text_of("etcd://a:1,b.c-d:2379"), "etcd://a:1,b.c-d:2379 rtpm");
  EXPECT_EQ(text_of("etcd://a"), "etcd://a:2379 rtpm");
  EXPECT_EQ(text_of("etcd://10.0.0.1:2379/site/a"), "etcd://10.0.0.1:2379/site/a site/a");
  for (const char* bad : {"etcd://", "etcd://,", "etcd://a:0", "etcd://a:65536", "etcd://a:1x",
                          "etcd://a b", "etcd://a/", "etcd://a//b", "etcd://u@a", "http://a",
                          "etcd://a,a,a,a,a,a,a,a,a,a,a,a,a,a,a,a,a"}) {
    expect_text(text_of(bad), {"refused: ", "Remedy: give etcd://"});
  }
}

TEST(Base64, MatchesTheStandard) {
  for (const auto& [bytes, text] :
       {std::pair{"", ""}, std::pair{"f", "Zg=="}, std::pair{"fo", "Zm8="},
        std::pair{"foo", "Zm9v"}, std::pair{"foob", "Zm9vYg=="}}) {
    EXPECT_EQ(etcd_store::to_base64(bytes), text);
    EXPECT_EQ(etcd_store::from_base64(text), bytes);
  }
  for (const char* bad : {"Z", "Zg=", "Z===", "Zm9%", "Zg==Zg=="})
    EXPECT_FALSE(etcd_store::from_base64(bad)) << bad;
}

}  // namespace
}  // namespace rtpm::storage_test

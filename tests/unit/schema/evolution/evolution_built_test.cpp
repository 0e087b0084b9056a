#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "evolution_samples.hpp"
#include "scratch_folder.hpp"

// One edit of each kind with generated and built code: one program has all old versions, another
// all new ones; each serves while the other calls.
namespace rtpm::schema {
namespace {

using test::EvolutionSample;
using test::Side;

/// A program's report on one method of one sample; method 0 is the bind.
struct Entry {
  std::string what{};  ///< "bound", "request", "reply" or "error".
  std::string rest{};  ///< Bytes, or the error's text.
};
using Report = std::map<std::pair<int, int>, Entry>;

Report parse(const std::string& text) {
  Report report;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    int sample = 0;
    int method = 0;
    Entry entry;
    if (!(words >> sample >> method >> entry.what)) continue;
    std::getline(words >> std::ws, entry.rest);
    if (entry.what != "error") {
      std::string bytes;
      for (std::size_t i = 0; i + 1 < entry.rest.size(); i += 2)
        bytes += static_cast<char>(std::stoi(entry.rest.substr(i, 2), nullptr, 16));
      entry.rest = bytes;
    }
    report[{sample, method}] = entry;
  }
  return report;
}

struct Exchange {
  Report client;
  Report server;
};

std::string await_port(const std::filesystem::path& file) {
  for (int i = 0; i < 2000; ++i) {
    const std::string text = test::read_file(file);
    if (text.starts_with("port ") && text.find('\n') != std::string::npos) {
      return text.substr(5, text.find('\n') - 5);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  }
  ADD_FAILURE() << "the server tells no port";
  return "1";
}

Exchange exchange(const std::string& client, const std::string& server) {
  const test::ScratchFolder folder;
  const std::filesystem::path served = folder.path() / "served";
  const std::filesystem::path called = folder.path() / "called";
  folder.write("served", "");
  std::FILE* const running =
      popen(('\'' + server + "' serve > '" + served.string() + '\'').c_str(), "w");
  const std::string port = await_port(served);
  const std::string command =
      '\'' + client + "' call 127.0.0.1:" + port + " > '" + called.string() + '\'';
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(pclose(running), 0);
  return {parse(test::read_file(called)), parse(test::read_file(served))};
}

/// Packing omits empty vectors and texts.
nlohmann::json packed(nlohmann::json value) {
  if (value.is_array() && value.empty()) return nullptr;
  if (value.is_structured()) {
    for (auto& inner : value)
      inner = packed(inner);
  }
  return value;
}

/// Whether `reader` read what `writer` wrote.
bool arrived(const Side& writer, const Payload& sent, const std::string& bytes, const Side& reader,
             const Payload& expected, const std::string& repacked) {
  const auto name = [](const Side& side, const Payload& payload) {
    return side.model().objects[payload.table].name;
  };
  const auto written = writer.read(name(writer, sent), sent.kind, bytes, bytes);
  const auto read = reader.read(name(reader, expected), expected.kind, repacked, {});
  const bool is_good = written && read && test::is_understood(packed(*written), packed(*read));
  EXPECT_TRUE(is_good) << "written " << (written ? packed(*written).dump() : "nothing") << "\nread "
                       << (read ? packed(*read).dump() : "nothing");
  return is_good;
}

/// Whether all methods of a sample were called and all payloads understood.
bool is_understood_throughout(int sample, Side& client, Side& server, const Exchange& exchange) {
  for (const Method& method : client.model().services.front().methods) {
    const auto& methods = server.model().services.front().methods;
    const auto serving = std::find_if(methods.begin(), methods.end(),
                                      [&](const Method& one) { return one.id == method.id; });
    const auto request = exchange.server.find({sample, method.id});
    const auto reply = exchange.client.find({sample, method.id});
    if (serving == methods.end() || request == exchange.server.end() ||
        reply == exchange.client.end() || reply->second.what != "reply") {
      ADD_FAILURE() << "sample " << sample << ": method " << method.name << " is not answered: "
                    << (reply == exchange.client.end() ? "" : reply->second.rest);
      return false;
    }
    if (!arrived(client, method.request, sample_message(client, method.request, method.id, true),
                 server, serving->request, request->second.rest) ||
        !arrived(server, serving->reply, sample_message(server, serving->reply, method.id, false),
                 client, method.reply, reply->second.rest)) {
      ADD_FAILURE() << "sample " << sample << ": method " << method.name << " is misunderstood";
      return false;
    }
  }
  return true;
}

/// Every sample, with clients of one version and servers of the other.
int expect_as_reported(const std::vector<EvolutionSample>& samples, bool are_clients_old) {
  const std::string before = RTPM_EVOLUTION_PEER "before";
  const std::string after = RTPM_EVOLUTION_PEER "after";
  const Exchange exchanged = are_clients_old ? exchange(before, after) : exchange(after, before);
  int bound_count = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto number = static_cast<int>(i);
    Side old_side(samples[i].before);
    Side new_side(samples[i].after);
    bool is_reported_to_break = false;
    bool is_limit = false;
    for (const Change& change : compare(old_side.model(), new_side.model())) {
      is_reported_to_break |=
          are_clients_old ? change.breaks_old_clients : change.breaks_new_clients;
      is_limit |= change.kind == ChangeKind::kFieldRangeNarrowed ||
                  change.kind == ChangeKind::kFieldRangeWidened ||
                  ((change.kind == ChangeKind::kFieldRemoved ||
                    change.kind == ChangeKind::kEnumValueRemoved) &&
                   change.reading.is_by_meaning);
    }
    const auto bind = exchanged.client.find({number, 0});
    if (bind == exchanged.client.end()) {
      ADD_FAILURE() << "no report on sample " << i;
      continue;
    }
    const bool is_bound = bind->second.what == "bound";
    const std::string words = "sample " + std::to_string(i) + ", " +
                              std::string(name_of(samples[i].kind)) + ": " + bind->second.rest;
    // The calls alone judge changes that a bind cannot detect.
    if (!is_limit) {
      EXPECT_EQ(is_bound, !is_reported_to_break) << words;
    }
    if (!is_bound) {
      EXPECT_NE(bind->second.rest.find("has another lab"), std::string::npos) << words;
      continue;
    }
    ++bound_count;
    Side& client = are_clients_old ? old_side : new_side;
    Side& server = are_clients_old ? new_side : old_side;
    EXPECT_TRUE(is_understood_throughout(number, client, server, exchanged)) << words;
  }
  return bound_count;
}

TEST(EvolutionBuilt, OldAndNewProgramsInteroperateAsReported) {
  const std::vector<EvolutionSample> samples = test::evolution_samples();
  EXPECT_GE(samples.size(), 28u);
  const int old_clients = expect_as_reported(samples, true);
  const int new_clients = expect_as_reported(samples, false);
  RecordProperty("samples", static_cast<int>(samples.size()));
  RecordProperty("old clients bound", old_clients);
  RecordProperty("new clients bound", new_clients);
  EXPECT_GE(old_clients, 8);
  EXPECT_GE(new_clients, 8);
}

}  // namespace
}  // namespace rtpm::schema

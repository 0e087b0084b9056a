#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "rtpm/schema/conform.hpp"
#include "scratch_folder.hpp"

// A sample of the evolution test with code that is really generated and built: three versions of
// one interface, each a program of its own, in every combination.
namespace rtpm::schema {
namespace {

namespace fs = std::filesystem;

int run(const std::string& command) {
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string peer(int version) {
  return "'" RTPM_EVOLUTION_PEER + std::to_string(version) + "' ";
}

/// What the client of one version reads of the answer of a server of another; "refused" if the
/// server does not take the request, "unreadable" if the client does not take the reply.
std::string ask(int client, int server) {
  const test::ScratchFolder folder;
  const std::string cd = "cd '" + folder.path().string() + "' && ";
  EXPECT_EQ(run(cd + peer(client) + "ask request"), 0);
  if (run(cd + peer(server) + "serve 2 request reply") != 0) return "refused";
  if (run(cd + peer(client) + "read reply > text") != 0) return "unreadable";
  return test::read_file(folder.path() / "text");
}

int push(int client, int server) {
  const test::ScratchFolder folder;
  const std::string cd = "cd '" + folder.path().string() + "' && ";
  EXPECT_EQ(run(cd + peer(client) + "push request"), 0);
  return run(cd + peer(server) + "serve 1 request reply");
}

std::vector<Change> changes_between(int before, int after) {
  const auto model = [](int version) {
    const CompileResult result = compile(
        {.file = fs::path(RTPM_EVOLUTION_FOLDER) / ("v" + std::to_string(version)) / "arm.fbs",
         .include_paths = {RTPM_IDL_FOLDER}});
    EXPECT_TRUE(result.model) << render(result.errors);
    return *result.model;
  };
  return compare(model(before), model(after));
}

TEST(EvolutionPeers, AVersionThatConformsIsUnderstood) {
  for (const Change& change : changes_between(1, 2)) {
    EXPECT_FALSE(change.breaks_old_clients) << render(change.diagnostic);
    // The new method is all that a newer client misses.
    EXPECT_EQ(change.breaks_new_clients, change.kind == ChangeKind::kMethodAdded);
  }
  EXPECT_EQ(ask(1, 1), "take 1 1000 -1\n");
  EXPECT_EQ(ask(1, 2), "take 1 1000 -1\n");
  EXPECT_EQ(ask(2, 1), "take 1 1000 -1\n");
  EXPECT_EQ(push(1, 2), 0);
  EXPECT_EQ(push(2, 1), 0);
}

TEST(EvolutionPeers, AVersionThatDoesNotConformIsNot) {
  bool breaks_old_clients = false;
  bool breaks_new_clients = false;
  for (const Change& change : changes_between(1, 3)) {
    breaks_old_clients |= change.breaks_old_clients;
    breaks_new_clients |= change.breaks_new_clients;
  }
  EXPECT_TRUE(breaks_old_clients);
  EXPECT_TRUE(breaks_new_clients);
  EXPECT_EQ(ask(3, 3), "take 1 500 -1\n");
  EXPECT_EQ(ask(1, 3), "refused");
  EXPECT_NE(ask(3, 1), "take 1 500 -1\n");
  EXPECT_NE(push(1, 3), 0);
  EXPECT_NE(push(3, 1), 0);
}

}  // namespace
}  // namespace rtpm::schema

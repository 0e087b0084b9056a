#include <memory>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "keys/parts.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/access/known_servers.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/wire/url.hpp"

// Lists the contents of the key folder, for users who look for a fault.
namespace rtpm::tool {
namespace {

/// The files and their faults.
struct Listing {
  Json json = Json::object();
  std::string text{};
  bool is_faulty = false;

  void add_fault(const std::string& what) {
    is_faulty = true;
    text += "  fault: " + what + "\n";
    json["faults"].push_back(what);
  }
  void add_faults(const std::vector<access::LineFault>& faults, std::size_t count,
                  const std::string& file) {
    for (const access::LineFault& fault : faults)
      add_fault(access::to_text(fault, file));
    if (count > faults.size())
      add_fault(printable(file) + ": " + std::to_string(count - faults.size()) + " more");
  }
};

void list_own(Listing& listing, const std::string& file) {
  listing.text += "own key: " + printable(file, kShownWhole) + "\n";
  if (!access::stamp_of(file).is_of_file()) {
    listing.json["key"] = nullptr;
    listing.text += "  none; `rtpm key new` makes it\n";
    return;
  }
  const auto pair = access::read_key(file);
  if (!pair) {
    listing.json["key"] = nullptr;
    listing.add_fault(pair.error().text());
    return;
  }
  const std::string comment = access::key_comment(file);
  listing.json["key"] = {{"file", file},
                         {"public_key", access::public_key_text(pair->public_key)},
                         {"fingerprint", access::fingerprint(pair->public_key)},
                         {"comment", comment}};
  listing.text += "  " + access::fingerprint(pair->public_key) + "  " + comment + "\n";
}

void list_servers(Listing& listing, const std::string& file) {
  listing.text += "known servers: " + printable(file, kShownWhole) + "\n";
  listing.json["known_servers"] = Json::array();
  const auto text = access::read_trusted_file(file);
  if (!text) return listing.add_fault(text.error().text());
  const access::KnownServers read = access::parse_known_servers(*text);
  std::vector<Row> rows;
  for (const access::KnownServer& server : read.servers) {
    const std::string place = server.port == 0 ? wire::host_in_url(server.host)
                                               : wire::host_and_port(server.host, server.port);
    rows.push_back({"  " + printable(place), access::fingerprint(server.key)});
    listing.json["known_servers"].push_back({{"host", server.host},
                                             {"port", server.port},
                                             {"public_key", access::public_key_text(server.key)},
                                             {"fingerprint", access::fingerprint(server.key)},
                                             {"line", server.line}});
  }
  listing.json["local_users"] = read.local_users;
  for (const std::uint32_t user : read.local_users)
    rows.push_back({"  local uid:" + std::to_string(user), "shares memory with this user"});
  listing.text += rows.empty() ? "  none; `rtpm key learn HOST` adds one\n" : aligned(rows, 2);
  listing.add_faults(read.faults, read.fault_count, file);
}

/// "3f2a-…", "uid:1000", "anonymous".
std::string short_text(const access::Subject& subject) {
  const bool is_key = subject.kind == access::Subject::Kind::kKey;
  return is_key ? access::fingerprint(subject.key) : access::to_text(subject);
}

/// The grant's line without its subject and name.
std::string what_of(const access::Grant& grant) {
  const std::string line = access::to_line(grant);
  return line.substr(line.find("role=") + 5);
}

void list_grants(Listing& listing, const std::string& file) {
  listing.text += "grants at this user's servers: " + printable(file, kShownWhole) + "\n";
  listing.json["grants"] = Json::array();
  const auto text = access::read_trusted_file(file);
  if (!text) return listing.add_fault(text.error().text());
  std::vector<Row> rows;
  for (const GrantLine& each : grant_lines_of(*text)) {
    rows.push_back({"  " + short_text(each.grant.subject), printable(each.grant.name),
                    printable(what_of(each.grant))});
    listing.json["grants"].push_back({{"subject", access::to_text(each.grant.subject)},
                                      {"name", each.grant.name},
                                      {"role", std::string(access::to_string(each.grant.role))},
                                      {"line", each.number},
                                      {"text", access::to_line(each.grant)}});
  }
  listing.text += rows.empty() ? "  none; `rtpm key authorize` adds one\n" : aligned(rows, 3);
  const access::Authorized read = access::parse_authorized(*text);
  listing.add_faults(read.faults, read.fault_count, file);
}

int list_keys(Context& context, const std::string& authorized_file) {
  const auto key = access::key_file_path(context.security.key_file, access::kKeyFile);
  if (!key) return context.fail(key.error());
  const auto servers =
      access::key_file_path(context.security.known_servers_file, access::kKnownServersFile);
  const auto grants = access::key_file_path(authorized_file, access::kAuthorizedFile);
  if (!servers || !grants) return context.fail(servers ? grants.error() : servers.error());
  Listing listing;
  listing.json["faults"] = Json::array();
  list_own(listing, *key);
  list_servers(listing, *servers);
  list_grants(listing, *grants);
  if (context.json) {
    print_json(listing.json);
  } else {
    listing.text.pop_back();
    print_line(listing.text);
  }
  return listing.is_faulty ? kFailed : kDone;
}

}  // namespace

void add_key_list(CLI::App& group, Context& context) {
  const auto authorized = std::make_shared<std::string>();
  CLI::App& command =
      add_command(group, context, "list", "Show your key, known servers and grants, and faults",
                  "  rtpm key list\n"
                  "The exit code is 1 if a file has a fault.\n",
                  [authorized](Context& c) { return list_keys(c, *authorized); });
  command.add_option("--authorized", *authorized, "The file of grants; without: yours")
      ->type_name("FILE");
}

}  // namespace rtpm::tool

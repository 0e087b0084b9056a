#include "host/keys.hpp"

#include <string>
#include <utility>

#include "rtpm/access/authorized.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/known_servers.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rpc/lane_table.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

/// "authorized:3:14: …, and 2 more faults".
std::string text_of_faults(const std::vector<access::LineFault>& faults, std::size_t count,
                           const std::string& file) {
  std::string text = access::to_text(faults.front(), printable(file, kShownWhole));
  if (count > 1) text += ", and " + std::to_string(count - 1) + " more";
  return text;
}

/// Marks a file as unused, and states what that costs.
void set_unused(Finding& finding, const SetupError& error, std::string cost) {
  finding.severity = Severity::kProblem;
  finding.text = error.reason();
  finding.cost = std::move(cost);
  finding.remedy = error.remedy;
}

Finding judge_key(const std::string& file, bool is_needed) {
  Finding finding{.id = "key"};
  if (!access::stamp_of(file).is_of_file()) {
    finding.text = "this user has no key";
    if (!is_needed) return finding;
    finding.severity = Severity::kProblem;
    finding.text += ", but known servers, which ask for one";
    finding.cost = "they refuse all calls of this user";
    finding.remedy = "rtpm key new";
    return finding;
  }
  const auto key = access::read_key(file);
  finding.text = "the key " + printable(file, kShownWhole) + " is its owner's alone";
  if (key) return finding;
  set_unused(finding, key.error(),
             "servers and callers of this user do not use it; if others could read it, it may be "
             "known to them");
  return finding;
}

Finding judge_known_servers(const std::string& file, const expected<std::string, SetupError>& text,
                            const access::KnownServers& read) {
  Finding finding{.id = "known-servers"};
  finding.text = std::to_string(read.servers.size()) + " keys of servers are known";
  if (!text) {
    set_unused(finding, text.error(), "no server is known");
  } else if (read.fault_count > 0) {
    finding.severity = Severity::kWarning;
    finding.text = text_of_faults(read.faults, read.fault_count, file);
    finding.cost = "that server is not known: it is called in plain";
    finding.remedy = "mend the line, or remove it and `rtpm key learn` the server";
  }
  return finding;
}

Finding judge_grants(const std::string& file) {
  Finding finding{.id = "grants"};
  const auto text = access::read_trusted_file(file);
  const access::Authorized read = access::parse_authorized(text ? *text : "");
  finding.text = std::to_string(read.grants.size()) + " grants in " + printable(file, kShownWhole);
  if (!text) {
    set_unused(finding, text.error(),
               "servers that ask for grants do not start, or keep the former ones");
  } else if (read.fault_count > 0) {
    finding.severity = Severity::kWarning;
    finding.text = text_of_faults(read.faults, read.fault_count, file);
    finding.cost = "that line allows nothing";
    finding.remedy = "mend it; `rtpm key list` shows all";
  }
  return finding;
}

}  // namespace

std::vector<Finding> survey_open_servers() {
  std::vector<Finding> findings;
  for (const rpc::LaneTable& table : rpc::LaneTable::find()) {
    if (!table.is_alive() || !table.is_open_to_network()) continue;
    findings.push_back({"open-server", Severity::kWarning,
                        "server '" + printable(table.server_name()) + "' of process " +
                            std::to_string(table.process_id()) + " serves " +
                            printable(table.host()) + ", port " + std::to_string(table.port()) +
                            ", without asking who calls",
                        "every program that reaches the port may do everything, also move devices",
                        "let callers in by `rtpm key authorize`, and start it without --insecure"});
  }
  return findings;
}

std::vector<Finding> survey_keys(const Context& context) {
  const auto key = access::key_file_path(context.security.key_file, access::kKeyFile);
  const auto servers =
      access::key_file_path(context.security.known_servers_file, access::kKnownServersFile);
  const auto grants = access::key_file_path({}, access::kAuthorizedFile);
  if (!key || !servers || !grants) {
    return {{"key", Severity::kNote, "there is no folder for keys: " + grants.error().reason(),
             "sealed sessions and grants are not used", grants.error().remedy}};
  }
  const auto text = access::read_trusted_file(*servers);
  const access::KnownServers known = access::parse_known_servers(text ? *text : "");
  std::vector<Finding> findings{judge_key(*key, !known.servers.empty())};
  if (!text || access::stamp_of(*servers).is_of_file())
    findings.push_back(judge_known_servers(*servers, text, known));
  if (access::stamp_of(*grants).is_of_file()) findings.push_back(judge_grants(*grants));
  return findings;
}

}  // namespace rtpm::tool

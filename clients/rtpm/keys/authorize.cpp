#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "keys/parts.hpp"
#include "rtpm/access/file_change.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/base/printable.hpp"

// Manages the grants at this user's servers.
namespace rtpm::tool {
namespace {

struct AuthorizeRequest {
  std::vector<std::string> subject{};
  std::string role{};
  std::string objects{};
  std::string name{};
  std::string ranges{};
  std::string ceiling{};
  std::string file{};
};

struct RevokeRequest {
  std::vector<std::string> who{};
  std::string file{};
};

/// Parses the options as a grant. They are joined into one line, so that the file's rules apply.
expected<access::Grant, SetupError> grant_of(const AuthorizeRequest& request) {
  const std::string subject = joined(request.subject);
  const auto key = access::parse_public_key(subject);
  std::string line = key ? access::public_key_text(*key) : subject;
  const std::string comment = key ? comment_of(subject) : std::string();
  const std::string name = request.name.empty() ? comment : request.name;
  if (request.name.empty() && comment.find_first_of(" \t") != std::string::npos) {
    return setup_error("the key's comment '" + printable(comment) + "' is no name",
                       "a name has no blank", "give one: --name " + as_name(comment));
  }
  const std::pair<const char*, std::string> settings[] = {{"name", name},
                                                          {"role", request.role},
                                                          {"on", request.objects},
                                                          {"max-priority", request.ceiling},
                                                          {"from", request.ranges}};
  for (const auto& [setting, value] : settings) {
    if (value.find_first_of(" \t\r\n") != std::string::npos)
      return setup_error("the " + std::string(setting) + " has a blank", "",
                         "write it without: '" + printable(value) + "'");
    if (!value.empty()) line.append(" ").append(setting).append("=").append(value);
  }
  const access::Authorized read = access::parse_authorized(line);
  if (read.grants.size() == 1 && read.fault_count == 0 && line.find('\n') == std::string::npos)
    return read.grants.front();
  return setup_error("this grants nothing",
                     read.faults.empty() ? "it names nobody" : read.faults.front().why,
                     "`rtpm key authorize --help` has an example");
}

Json grant_json(const std::string& file, const access::Grant& grant) {
  return {{"file", file}, {"line", access::to_line(grant)}};
}

int authorize(Context& context, const AuthorizeRequest& request) {
  const auto path = access::key_file_path(request.file, access::kAuthorizedFile);
  if (!path) return context.fail(path.error());
  const auto grant = grant_of(request);
  if (!grant) return context.fail(grant.error());
  const std::string line = access::to_line(*grant);
  const auto changed = access::change_trusted_file(
      *path, [&](const std::string& text) -> expected<std::string, SetupError> {
        const auto lines = grant_lines_of(text);
        const auto same = std::ranges::find(lines, *grant, &GrantLine::grant);
        if (same == lines.end()) return access::with_line(text, line);
        return setup_error(
            "it is granted already",
            printable(*path, kShownWhole) + ':' + std::to_string(same->number) + " says the same");
      });
  if (!changed) return context.fail(changed.error());
  if (context.json) {
    print_json(grant_json(*path, *grant));
    return kDone;
  }
  print_line(printable(line));
  print_line("is in " + printable(*path, kShownWhole) +
             ". Servers that use this file take it up within a second.");
  if (access::stamp_of(*path).size == static_cast<std::int64_t>(line.size()) + 1)
    print_line(
        "It is the first line. Servers at addresses beyond this host use the file from "
        "their next start on.");
  return kDone;
}

/// Whether `who`, as written by a user, is the subject of the grant.
bool is_of(const access::Grant& grant, const std::string& who) {
  if (!grant.name.empty() && grant.name == who) return true;
  const access::Subject& subject = grant.subject;
  if (subject.kind != access::Subject::Kind::kKey) return access::to_text(subject) == who;
  return access::parse_public_key(who) == subject.key ||
         access::is_fingerprint_of(who, subject.key) ||
         "rtpm25519 " + who == access::public_key_text(subject.key);
}

int revoke(Context& context, const RevokeRequest& request) {
  const auto path = access::key_file_path(request.file, access::kAuthorizedFile);
  if (!path) return context.fail(path.error());
  const std::string who = joined(request.who);
  std::vector<GrantLine> removed;
  const auto changed = access::change_trusted_file(
      *path, [&](const std::string& text) -> expected<std::string, SetupError> {
        removed = grant_lines_of(text);
        std::erase_if(removed, [&](const GrantLine& each) { return !is_of(each.grant, who); });
        std::vector<std::size_t> numbers;
        for (const GrantLine& each : removed)
          numbers.push_back(each.number);
        if (!numbers.empty()) return access::without_lines(text, numbers);
        return setup_error(
            "no line of " + printable(*path, kShownWhole) + " is for '" + printable(who) + "'", "",
            "`rtpm key list` shows all");
      });
  if (!changed) return context.fail(changed.error());
  for (const GrantLine& each : removed) {
    if (context.json) {
      print_json(grant_json(*path, each.grant));
    } else {
      print_line("removed line " + std::to_string(each.number) + ": " +
                 printable(access::to_line(each.grant)));
    }
  }
  if (!context.json)
    print_line("Servers that use " + printable(*path, kShownWhole) +
               " take it up within a second: its sessions end, or do less.");
  return kDone;
}

}  // namespace

void add_key_authorize(CLI::App& group, Context& context) {
  const auto request = std::make_shared<AuthorizeRequest>();
  CLI::App& command = add_command(
      group, context, "authorize", "Let a key, a user of this host or anybody use your servers",
      "  rtpm key authorize 'rtpm25519 KEY alice@lab' --role command --on 'lab/**'\n"
      "  rtpm key authorize uid:1001 --name logger --role observe --on '**'\n"
      "  rtpm key authorize anonymous --role observe --on 'public/*' --from 192.168.7.0/24\n"
      "The key is the line that `rtpm key show` prints at the caller. Roles: observe < command <\n"
      "configure < administer. * is one component of a path, ** any number. Lines add up.\n",
      [request](Context& c) { return authorize(c, *request); });
  command.add_option("WHO", request->subject, "A public key, uid:NUMBER or anonymous")
      ->required()
      ->type_name("");
  command.add_option("--role", request->role, "What they may do")
      ->required()
      ->check(CLI::IsMember({"observe", "command", "configure", "administer"}))
      ->type_name("ROLE");
  command.add_option("--on", request->objects, "The objects, with ',' between")
      ->required()
      ->type_name("PATTERNS");
  command.add_option("--name", request->name, "For logs; without: the key's comment")
      ->type_name("NAME");
  command
      .add_option("--from", request->ranges, "Addresses and ranges with ',' between; without: any")
      ->type_name("RANGES");
  command.add_option("--max-priority", request->ceiling, "The highest priority of their calls")
      ->type_name("0..32767");
  command.add_option("--file,--authorized", request->file, "The file of grants; without: yours")
      ->type_name("FILE");
}

void add_key_revoke(CLI::App& group, Context& context) {
  const auto request = std::make_shared<RevokeRequest>();
  CLI::App& command = add_command(
      group, context, "revoke", "Remove all grants of a key, a user or a name",
      "  rtpm key revoke alice@lab\n"
      "WHO is a name, a public key, its fingerprint, uid:NUMBER or anonymous. Sessions end within\n"
      "a second, also in mid-call.\n",
      [request](Context& c) { return revoke(c, *request); });
  command.add_option("WHO", request->who, "Whose")->required()->type_name("");
  command.add_option("--file,--authorized", request->file, "The file of grants; without: yours")
      ->type_name("FILE");
}

}  // namespace rtpm::tool

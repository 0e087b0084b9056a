#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "keys/parts.hpp"
#include "os/system.hpp"
#include "rtpm/access/file_change.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/access/known_servers.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/base/whole_number.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/line_reader.hpp"
#include "rtpm/rpc/server_key.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/wire/url.hpp"

// Manages the servers that this user's programs know, by their keys.
namespace rtpm::tool {
namespace {

struct LearnRequest {
  std::string target{};
  std::string fingerprint{};
  bool is_sure = false;
  bool is_port_only = false;
};

constexpr Duration kAskPatience = std::chrono::seconds{2};
constexpr Duration kLookInterval = std::chrono::milliseconds{100};

/// The hosts and the port of a server, without its path.
using Place = wire::Url;

expected<Place, SetupError> place_in_url(const std::string& text) {
  auto url = wire::parse_url(text);
  if (url) return std::move(*url);
  return setup_error("'" + printable(text) + "' is no server", "",
                     "write HOST, HOST:PORT, [IPV6]:PORT, rtpm://HOST:PORT/PATH or a name such as "
                     "lab/arm0");
}

/// Parses HOST[:PORT]; the default port is the registry's.
expected<Place, SetupError> place_of_host(const std::string& text) {
  const std::string port = ":" + std::to_string(names::kDefaultRegistryPort);
  const bool is_bare_ipv6 = wire::is_ipv6_address(text);
  const std::string host = is_bare_ipv6 ? "[" + text + "]" : text;
  const bool has_port = !is_bare_ipv6 && !text.ends_with(']') && text.find(':') != text.npos;
  return place_in_url("rtpm://" + host + (has_port ? "" : port) + "/any");
}

/// Locates the target by its URL, its host, or its name, which contains a '/'.
expected<Place, SetupError> place_of(Context& context, const std::string& target) {
  if (wire::is_url(target)) return place_in_url(target);
  if (target.find('/') == std::string::npos) return place_of_host(target);
  names::Directory directory(context.node(), context.registry);
  const auto url = directory.url_of(target);
  if (!url) return unexpected<SetupError>{url.error()};
  return place_in_url(*url);
}

/// The names by which a binding may call this host: as given, and its resolved addresses.
std::vector<std::string> hosts_named(const Place& place, MonotonicTime deadline) {
  std::vector<std::string> hosts = place.hosts;
  for (const std::string& host : place.hosts) {
    const auto addresses = transport::addresses_of(host, place.port, deadline);
    if (!addresses) continue;
    for (const transport::SocketAddress& address : *addresses) {
      if (std::ranges::find(hosts, address.host()) == hosts.end()) hosts.push_back(address.host());
    }
  }
  return hosts;
}

bool is_loopback(const std::string& host) {
  const auto address = transport::SocketAddress::parse(host, 0);
  return host == "localhost" || (address && address->is_loopback());
}

/// A server's key, and the hosts that showed it.
struct Shown {
  crypto::PublicKey key{};
  std::vector<access::KnownServer> servers{};
};

/// Asks each host for its key.
expected<Shown, SetupError> ask(Context& context, const Place& place, bool is_port_only) {
  const Duration patience = context.deadline.value_or(kAskPatience);
  Shown shown;
  std::optional<SetupError> error;
  for (const std::string& host : hosts_named(place, rt::now() + patience)) {
    const auto key = rpc::ask_server_key(host, place.port, rt::now() + patience);
    if (!key) {
      if (!error) error = key.error();
      continue;
    }
    if (!shown.servers.empty() && *key != shown.key)
      return setup_error("the hosts of " + place.authority() + " show different keys", "",
                         "learn each by itself: HOST:PORT");
    shown.key = *key;
    // On another host, all programs of a user share a key; on this host they may belong to many
    // users.
    const bool has_port = is_port_only || is_loopback(host);
    shown.servers.push_back({host, has_port ? place.port : std::uint16_t{0}, *key, 0});
  }
  if (shown.servers.empty()) return unexpected{std::move(*error)};
  return shown;
}

/// The valid line that states another key for the server than the one shown; nullptr if none.
const access::KnownServer* contradicting(const std::vector<access::KnownServer>& known,
                                         const access::KnownServer& shown) {
  const auto is_for_same = [&](const access::KnownServer& each) {
    return each.host == shown.host && each.port == shown.port;
  };
  const auto found = std::ranges::find_if(known, is_for_same);
  const bool has_key = std::ranges::any_of(known, [&](const access::KnownServer& each) {
    return is_for_same(each) && each.key == shown.key;
  });
  return found == known.end() || has_key ? nullptr : &*found;
}

SetupError other_key(const std::string& file, const access::KnownServer& known,
                     const access::KnownServer& shown) {
  const std::string host = wire::host_in_url(known.host);
  const std::string place = known.port == 0 ? host : wire::host_and_port(known.host, known.port);
  return {"the server at " + host + " shows another key, fingerprint " +
              access::fingerprint(shown.key) + ", than the known one",
          printable(file, kShownWhole) + ':' + std::to_string(known.line) + " has fingerprint " +
              access::fingerprint(known.key) +
              "; somebody may pose as the server, or its key was replaced",
          "compare with `rtpm key show` at the server; if it shows the new one: rtpm key forget " +
              place + ", then learn again; if it is a second server on that host: --port-only"};
}

/// The servers in `shown` that are not in the file yet.
expected<std::vector<access::KnownServer>, SetupError> new_ones(const std::string& file,
                                                                const std::string& text,
                                                                const Shown& shown) {
  const std::vector<access::KnownServer> known = access::parse_known_servers(text).servers;
  std::vector<access::KnownServer> added;
  for (const access::KnownServer& server : shown.servers) {
    if (const auto* other = contradicting(known, server))
      return unexpected{other_key(file, *other, server)};
    const bool is_there = std::ranges::any_of(known, [&](const access::KnownServer& each) {
      return each.host == server.host && each.port == server.port && each.key == server.key;
    });
    if (!is_there) added.push_back(server);
  }
  return added;
}

constexpr const char* kHowToCompare =
    "compare the fingerprint with what `rtpm key show` prints at the server, as the user who runs "
    "it";

/// Asks the user; returns whether the answer is yes.
bool asks_and_hears_yes(Context& context) {
  std::fputs("Is it the same there? [yes | no] ", stdout);
  std::fflush(stdout);
  program::LineReader input;
  std::string answer;
  while (!context.stop().is_requested()) {
    const auto outcome = input.read_for(kLookInterval, answer);
    if (outcome == program::LineReader::Outcome::kNone) continue;
    return outcome == program::LineReader::Outcome::kLine && answer == "yes";
  }
  return false;
}

/// Checks the shown key against the options, or asks the user.
expected<void, SetupError> confirm(Context& context, const LearnRequest& request,
                                   const crypto::PublicKey& key) {
  const std::string fingerprint = access::fingerprint(key);
  if (!request.fingerprint.empty()) {
    if (access::is_fingerprint_of(request.fingerprint, key)) return {};
    return setup_error("the server shows another key than the given one",
                       "its fingerprint is " + fingerprint, kHowToCompare);
  }
  if (request.is_sure) return {};
  if (context.json || !os::is_terminal(os::Stream::kInput))
    return setup_error("the key of " + printable(request.target) + " was not learned",
                       "its fingerprint is " + fingerprint + ", and nobody can be asked here",
                       std::string(kHowToCompare) + ", then give --fingerprint " + fingerprint +
                           "; or trust the network once: --yes");
  print_line(printable(request.target) + " shows this key:\n  " + access::public_key_text(key) +
             "\n  fingerprint " + fingerprint + "\nNobody vouches for it yet: " + kHowToCompare +
             ".");
  if (asks_and_hears_yes(context)) return {};
  return setup_error("the key was not learned", "it was not confirmed", kHowToCompare);
}

void tell_learned(const Context& context, const std::string& file, const Shown& shown,
                  const std::vector<access::KnownServer>& added) {
  if (context.json) {
    Json lines = Json::array();
    for (const access::KnownServer& server : added)
      lines.push_back(access::to_line(server));
    print_json({{"file", file},
                {"public_key", access::public_key_text(shown.key)},
                {"fingerprint", access::fingerprint(shown.key)},
                {"added", std::move(lines)}});
    return;
  }
  if (added.empty()) {
    print_line("known already, fingerprint " + access::fingerprint(shown.key));
    return;
  }
  for (const access::KnownServer& server : added)
    print_line(printable(access::to_line(server)));
  print_line(std::string(added.size() == 1 ? "is" : "are") + " in " + printable(file, kShownWhole) +
             ". From now on these servers are called over sealed sessions only.");
}

int learn(Context& context, const LearnRequest& request) {
  static_cast<void>(context.stop());
  const auto path =
      access::key_file_path(context.security.known_servers_file, access::kKnownServersFile);
  if (!path) return context.fail(path.error());
  const auto place = place_of(context, request.target);
  if (!place) return context.not_reached(place.error());
  const auto shown = ask(context, *place, request.is_port_only);
  if (!shown) {
    SetupError error = shown.error();
    if (place->port == names::kDefaultRegistryPort)
      error.remedy += "; without a port the registry's is asked: HOST:PORT is any server's";
    return context.not_reached(error);
  }
  const auto text = access::read_trusted_file(*path);
  if (!text) return context.fail(text.error());
  auto added = new_ones(*path, *text, *shown);
  if (!added) return context.fail(added.error());
  if (!added->empty()) {
    if (const auto sure = confirm(context, request, shown->key); !sure)
      return context.fail(sure.error());
    const auto changed = access::change_trusted_file(
        *path, [&](const std::string& now) -> expected<std::string, SetupError> {
          added = new_ones(*path, now, *shown);
          if (!added) return unexpected{added.error()};
          std::string next = now;
          for (const access::KnownServer& server : *added)
            next = access::with_line(std::move(next), access::to_line(server));
          return next;
        });
    if (!changed) return context.fail(changed.error());
  }
  tell_learned(context, *path, *shown, *added);
  return kDone;
}

/// The lines for a host, or for one of its ports.
std::vector<access::KnownServer> known_at(const std::string& text, const std::string& target) {
  std::vector<access::KnownServer> found;
  for (const access::KnownServer& each : access::parse_known_servers(text).servers) {
    const std::string host = wire::host_in_url(each.host);
    const bool is_host = target == each.host || target == host;
    const bool is_place = each.port != 0 && target == wire::host_and_port(each.host, each.port);
    if (is_host || is_place) found.push_back(each);
  }
  return found;
}

int forget(Context& context, const std::string& target) {
  const auto path =
      access::key_file_path(context.security.known_servers_file, access::kKnownServersFile);
  if (!path) return context.fail(path.error());
  std::vector<access::KnownServer> removed;
  const auto changed = access::change_trusted_file(
      *path, [&](const std::string& text) -> expected<std::string, SetupError> {
        removed = known_at(text, target);
        std::vector<std::size_t> numbers;
        for (const access::KnownServer& each : removed)
          numbers.push_back(each.line);
        if (!numbers.empty()) return access::without_lines(text, numbers);
        return setup_error(
            "no line of " + printable(*path, kShownWhole) + " is for '" + printable(target) + "'",
            "", "`rtpm key list` shows all");
      });
  if (!changed) return context.fail(changed.error());
  for (const access::KnownServer& each : removed) {
    if (context.json) {
      print_json({{"file", *path}, {"line", access::to_line(each)}});
    } else {
      print_line("removed line " + std::to_string(each.line) + ": " +
                 printable(access::to_line(each)));
    }
  }
  return kDone;
}

}  // namespace

void add_key_learn(CLI::App& group, Context& context) {
  const auto request = std::make_shared<LearnRequest>();
  CLI::App& command = add_command(
      group, context, "learn", "Learn the key of a server, to call it over sealed sessions",
      "  rtpm key learn 192.168.7.4\n"
      "The server is asked for its key, nobody vouches for the answer: compare its fingerprint\n"
      "with `rtpm key show` at the server. The key then stands for all servers of that host, as\n"
      "those of one user have one key; with --port-only, and at loopback addresses, for this "
      "one.\n",
      [request](Context& c) { return learn(c, *request); });
  command
      .add_option("SERVER", request->target,
                  "HOST, HOST:PORT, a URL, or a name such as lab/arm0; without PORT: the registry")
      ->required()
      ->type_name("");
  command.add_option("--fingerprint", request->fingerprint, "Learn this key only, without asking")
      ->type_name("TEXT");
  command.add_flag("--yes", request->is_sure, "Trust the network this once, without asking");
  command.add_flag("--port-only", request->is_port_only, "The key is of this port's server only");
}

void add_key_forget(CLI::App& group, Context& context) {
  const auto target = std::make_shared<std::string>();
  CLI::App& command = add_command(group, context, "forget", "Forget the keys of a host or server",
                                  "  rtpm key forget 192.168.7.4\n"
                                  "A host that is not known is called in plain.\n",
                                  [target](Context& c) { return forget(c, *target); });
  command.add_option("SERVER", *target, "HOST or HOST:PORT, as `rtpm key list` has it")
      ->required()
      ->type_name("");
}

}  // namespace rtpm::tool

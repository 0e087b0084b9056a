#include <memory>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "keys/parts.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/base/printable.hpp"

// The key of this user's programs.
namespace rtpm::tool {
namespace {

struct NewKeyRequest {
  std::string comment{};
  std::string file{};
};

std::string public_line(const crypto::PublicKey& key, const std::string& comment) {
  return access::public_key_text(key) + (comment.empty() ? "" : " " + printable(comment));
}

Json key_json(const std::string& file, const crypto::PublicKey& key, const std::string& comment) {
  return {{"file", file},
          {"public_key", access::public_key_text(key)},
          {"fingerprint", access::fingerprint(key)},
          {"comment", comment}};
}

/// Says the next steps with the key: at servers that the user calls, and on this host.
std::string next_steps(const std::string& line) {
  return "\nTo call a server with it: at that server, as the user who runs it,\n  " +
         authorize_command(line) +
         "\nand here\n  rtpm key learn HOST\nTo serve with it: `rtpm key authorize` here lets "
         "others in.";
}

int make_new(Context& context, const NewKeyRequest& request) {
  const std::string& given = request.file.empty() ? context.security.key_file : request.file;
  const auto path = access::key_file_path(given, access::kKeyFile);
  if (!path) return context.fail(path.error());
  const std::string comment = request.comment.empty() ? access::user_at_host() : request.comment;
  const auto pair = access::make_key(*path, comment);
  if (!pair) return context.fail(pair.error());
  if (context.json) {
    print_json(key_json(*path, pair->public_key, comment));
    return kDone;
  }
  const std::string line = public_line(pair->public_key, comment);
  print_line(line);
  print_line("\nThe key is in " + printable(*path, kShownWhole) + ", fingerprint " +
             access::fingerprint(pair->public_key) +
             ". The line above is its public half: anybody "
             "may see it.");
  print_line(next_steps(line));
  return kDone;
}

int show(Context& context, const std::string& file) {
  const std::string& given = file.empty() ? context.security.key_file : file;
  const auto path = access::key_file_path(given, access::kKeyFile);
  if (!path) return context.fail(path.error());
  const auto pair = access::read_key(*path);
  if (!pair) return context.fail(pair.error());
  const std::string comment = access::key_comment(*path);
  if (context.json) {
    print_json(key_json(*path, pair->public_key, comment));
    return kDone;
  }
  print_line(public_line(pair->public_key, comment));
  print_line("fingerprint " + access::fingerprint(pair->public_key));
  return kDone;
}

}  // namespace

void add_key_new(CLI::App& group, Context& context) {
  const auto request = std::make_shared<NewKeyRequest>();
  CLI::App& command =
      add_command(group, context, "new", "Make the key of your programs, and print its public half",
                  "  rtpm key new\n"
                  "All programs of a user on a host have one key, servers and callers. A key that\n"
                  "is there is never replaced. The file is ~/.config/rtpm/key, or in the folder\n"
                  "that RTPM_KEYS names.\n",
                  [request](Context& c) { return make_new(c, *request); });
  command.add_option("--comment", request->comment, "Without: user@host")->type_name("TEXT");
  command.add_option("--file", request->file, "Where to write it; without: --key, or the default")
      ->type_name("FILE");
}

void add_key_show(CLI::App& group, Context& context) {
  const auto file = std::make_shared<std::string>();
  CLI::App& command = add_command(
      group, context, "show", "Print the public half of a key, and its fingerprint",
      "  rtpm key show\n"
      "At a server, as the user who runs it: what `rtpm key learn` shows elsewhere must "
      "be the\nsame.\n",
      [file](Context& c) { return show(c, *file); });
  command.add_option("FILE", *file, "Of a key; without: --key, or the default")->type_name("");
}

}  // namespace rtpm::tool

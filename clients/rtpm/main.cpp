// rtpm: looks at servers and calls their objects from a terminal, without generated code.
#include <optional>
#include <string>
#include <vector>

#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/rpc/node.hpp"
#include "verbs.hpp"

int main(int argc, char** argv) {
  std::string verb;
  std::vector<std::string> arguments;
  std::string registry{rtpm::names::kDefaultRegistryUrl};
  std::optional<rtpm::Duration> deadline;
  rtpm::Duration stream_time{0};
  rtpm::Priority priority = 0;
  rtpm::options::Options options("rtpm", "looks at servers and calls their objects");
  options.add_positional("VERB", verb, "What to do", rtpm::options::Presence::kRequired);
  options.add_positional("ARGUMENTS", arguments,
                         "What the verb takes; a TARGET is a name or a URL");
  rtpm::tool::add_verbs(options);
  options.add_registry(registry);
  options.add_off_or_time("deadline", deadline,
                          "How long a call may take; off: the schema's deadline, else 1s",
                          {std::chrono::microseconds{1}, std::chrono::hours{1}});
  options.add("for", stream_time,
              "How long a stream is read or a device held; 0s: until it ends, or Ctrl-C",
              {rtpm::Duration{0}, std::chrono::hours{24}});
  options.add("priority", priority, "The call's priority");
  rtpm::tool::ConfigOptions config;
  options.add("revision", config.revision,
              "config: change only what has this revision; 0: whatever it has");
  options.add("answer", config.answers,
              "config calibrate: the answers to its prompts, the last for all that follow");
  options.add("keep", config.keeps, "config calibrate: keep the result without asking");
  options.add("discard", config.discards, "config calibrate: discard the result without asking");
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  if (config.keeps && config.discards) {
    return options.usage_error("--keep and --discard contradict each other; give one of them");
  }
  if (!rtpm::tool::takes(verb, arguments.size())) return options.usage_error_of_verb(verb);

  rtpm::rpc::Node node;
  rtpm::names::RegistryResolver resolver(node, registry);
  node.use(resolver);
  return rtpm::tool::run(
      verb,
      {.node = node,
       .registry = registry,
       .arguments = arguments,
       .options = {.priority = priority, .deadline = deadline, .trace_id = 0},
       .stream_time = stream_time > rtpm::Duration{0} ? std::optional(stream_time) : std::nullopt,
       .config = config});
}

#include "verbs.hpp"

#include <array>
#include <cstdio>
#include <memory>
#include <string_view>

#include "host_verbs.hpp"
#include "remote.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/stop_signal.hpp"

namespace rtpm::tool {
namespace {

int fail(const std::string& text) {
  std::fprintf(stderr, "rtpm: %s\n", text.c_str());
  return 1;
}

/// list: the names in the registry.   list TARGET: the objects of that server.
int list(const Request& request) {
  if (request.arguments.empty()) {
    names::Directory directory(request.node, request.registry);
    const auto entries = directory.list();
    if (!entries) return fail(entries.error().text);
    for (const names::NameEntry& entry : *entries) {
      std::printf("%s\t%s\t%s\n", entry.name.c_str(), entry.interface.c_str(), entry.url.c_str());
    }
    return 0;
  }
  const auto url = url_of(request.arguments[0], request.resolver);
  if (!url) return fail(url.error().text);
  auto catalog = introspection::IntrospectionClient::bind(request.node, catalog_url(*url));
  if (!catalog) return fail(catalog.error().text);
  const auto reply = catalog->list();
  if (!reply) return fail(std::string(to_string(reply.error())));
  for (const auto* object : *(*reply)->objects()) {
    std::printf("%s\t%s\n", object->path()->c_str(), object->interface()->c_str());
  }
  return 0;
}

int describe(const Request& request) {
  const auto url = url_of(request.arguments[0], request.resolver);
  if (!url) return fail(url.error().text);
  const auto object = RemoteObject::open(request.node, *url);
  if (!object) return fail(object.error().text);
  std::fputs((*object)->schema().c_str(), stdout);
  return 0;
}

bool is_stream_of(RemoteObject& object, const std::string& method) {
  const schema::Method* const found = object.dynamic().find(method);
  return found != nullptr && found->is_stream;
}

int call(const Request& request) {
  const auto url = url_of(request.arguments[0], request.resolver);
  if (!url) return fail(url.error().text);
  const auto object = RemoteObject::open(request.node, *url);
  if (!object) return fail(object.error().text);
  const std::string json = request.arguments.size() > 2 ? request.arguments[2] : std::string{};
  // Ctrl-C ends a stream in order, so that its server need not find out.
  const bool is_stream = is_stream_of(**object, request.arguments[1]);
  const auto stop = is_stream ? std::make_unique<program::StopSignal>() : nullptr;
  const auto print = [&](std::string_view text) {
    if (!text.empty()) {
      std::printf("%.*s\n", static_cast<int>(text.size()), text.data());
      std::fflush(stdout);
    }
    return stop == nullptr || !stop->is_requested();
  };
  const auto called =
      (*object)->call(request.arguments[1], json, request.options, request.stream_time, print);
  if (!called) return fail(request.arguments[1] + ": " + called.error().text);
  return 0;
}

struct Verb {
  std::string_view name{};
  std::size_t count_min = 0;  ///< Of arguments.
  std::size_t count_max = 0;
  std::string_view form{};
  int (*run)(const Request&) = nullptr;
};

constexpr std::array kVerbs{
    Verb{"list", 0, 1, "list [TARGET]: the registry's names, or a server's objects", &list},
    Verb{"describe", 1, 1, "describe TARGET: the schema of an object", &describe},
    Verb{"call", 2, 3,
         "call TARGET METHOD [JSON]: calls a method, such as "
         "`call lab/arm0 set_force '{x: 1}'`, and prints its reply, or a stream's items",
         &call},
    Verb{"lanes", 0, 1, "lanes [watch]: what the lanes of this host's servers do", &lanes},
    Verb{"doctor", 0, 0, "doctor: what this host gives to real-time programs", &doctor},
};

}  // namespace

std::string verbs_help() {
  std::string text;
  for (const Verb& verb : kVerbs)
    text += (text.empty() ? "" : "; ") + std::string(verb.form);
  return text;
}

int run(const std::string& name, const Request& request) {
  for (const Verb& verb : kVerbs) {
    if (verb.name != name) continue;
    const std::size_t count = request.arguments.size();
    if (count >= verb.count_min && count <= verb.count_max) return verb.run(request);
    std::fprintf(stderr, "rtpm: usage: rtpm %s\n", std::string(verb.form).c_str());
    return 2;
  }
  std::fprintf(stderr, "rtpm: unknown verb `%s`: rtpm --help lists those there are\n",
               name.c_str());
  return 2;
}

}  // namespace rtpm::tool

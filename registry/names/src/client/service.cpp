#include "client/service.hpp"

#include <algorithm>
#include <utility>

#include "client/no_answer.hpp"
#include "model/idl.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/registry_list.hpp"
#include "rtpm/rpc/tables.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::names {
namespace {

constexpr std::size_t kTroubleShownMax = 400;

/// One request in its own builder.
struct Request {
  flatbuffers::FlatBufferBuilder builder{512};
  template <class T>
  [[nodiscard]] ConstBytes finished(flatbuffers::Offset<T> root) {
    builder.Finish(root);
    return rpc::table_bytes(builder);
  }
  [[nodiscard]] flatbuffers::Offset<flatbuffers::String> text(std::string_view value) {
    return builder.CreateString(value.data(), value.size());
  }
};

/// Whether another registry may succeed: this one does not answer, or cannot reach the shared
/// storage.
template <class Reply>
bool is_for_another(const expected<Reply, DirectoryError>& reply) {
  if (!reply) return reply.error().cause != rpc::make_error_code(rpc::CallError::kNoResources);
  if constexpr (std::is_same_v<Reply, Answer>) {
    return outcome_of(*reply) == Outcome::kStoreUnreachable;
  } else if constexpr (requires { (*reply)->answer(); }) {
    return outcome_of(*(*reply)->answer()) == Outcome::kStoreUnreachable;
  }
  return false;
}

DirectoryError no_result(const std::string& url, rpc::CallError cause) {
  const std::string why(rpc::to_string(cause));
  switch (cause) {
    case rpc::CallError::kTimeout:
    case rpc::CallError::kExpired:
    case rpc::CallError::kDisconnected:
    case rpc::CallError::kUnreachable:
    case rpc::CallError::kNoResources:
      return no_answer(url, {why, {}, {}, rpc::make_error_code(cause)});
    default:
      return {{"the registry at " + url + " failed", why}};
  }
}

}  // namespace

Service::Service(rpc::Node& node, std::string url, Duration deadline)
    : node_(node), url_(std::move(url)), deadline_(deadline) {
  for (std::string& each : registries_of(url_))
    registries_.push_back({std::move(each)});
}

// Deadline of an operation that starts now.
MonotonicTime Service::usual_end() const {
  return rt::now() + deadline_;
}

// Runs `operation` at the registry that answered last, then at the next ones; ends by `deadline`.
template <class Operation>
auto Service::ask(MonotonicTime deadline, Operation operation) {
  const std::size_t first = preferred_;
  for (std::size_t i = 0;; ++i) {
    const std::size_t which = (first + i) % registries_.size();
    const bool is_last = i + 1 == registries_.size();
    const Duration left = deadline - rt::now();
    // Leaves time for the next one.
    auto reply = ask_at(registries_[which], rt::now() + (is_last ? left : left / 2), operation);
    if (is_last || !is_for_another(reply)) {
      preferred_ = which;
      return reply;
    }
  }
}

template <class Operation>
auto Service::ask_at(Registry& registry, MonotonicTime deadline, Operation operation) {
  using Reply = std::invoke_result_t<Operation, NamesClient&, const rpc::CallOptions&>;
  using Asked = expected<typename Reply::value_type, DirectoryError>;
  auto client = bound_client(registry, deadline);
  if (!client) return Asked(unexpected{std::move(client.error())});
  auto reply = operation(**client, rpc::CallOptions{.deadline = deadline - rt::now()});
  if (reply) return Asked(std::move(*reply));
  forget(registry, *client);
  return Asked(unexpected{no_result(registry.url, reply.error())});
}

// Requests an operation on `name` whose only result is success or a refusal.
template <class Operation>
expected<void, DirectoryError> Service::confirm(MonotonicTime deadline, std::string_view name,
                                                Operation operation) {
  const auto answer = ask(deadline, operation);
  if (!answer) return unexpected{answer.error()};
  if (outcome_of(*answer) == Outcome::kDone) return {};
  return unexpected{refused(*answer, name)};
}

// Requests pages of entries until the last one. Accepts only ascending names, so that no registry
// can make this endless.
template <class Operation, class Take>
expected<void, DirectoryError> Service::read_pages(std::string_view directory,
                                                   MonotonicTime deadline, Operation operation,
                                                   Take take) {
  std::string last;
  for (;;) {
    Request request;
    const auto below = request.text(directory);
    const ConstBytes bytes =
        request.finished(CreateListRequest(request.builder, below, request.text(last)));
    const auto reply = ask(std::min(deadline, usual_end()), [&](auto& client, const auto& options) {
      return operation(client, bytes, options);
    });
    if (!reply) return unexpected{reply.error()};
    const auto& page = **reply;
    if (outcome_of(*page.answer()) != Outcome::kDone) {
      return unexpected{refused(*page.answer(), directory)};
    }
    const std::string before = last;
    for (flatbuffers::uoffset_t i = 0; page.entries() != nullptr && i < page.entries()->size();
         ++i) {
      const auto& entry = *page.entries()->Get(i);
      if (entry.name()->string_view() <= last) continue;
      last = entry.name()->str();
      take(page, entry);
    }
    if (page.is_last() || last == before) return {};
  }
}

// Turns the registry's answer into an error; if its storage is unreachable, mentions that.
DirectoryError Service::refused(const Answer& answer, std::string_view name) {
  const Outcome outcome = outcome_of(answer);
  DirectoryError error{{outcome_text(outcome, name, answer.component())}, outcome};
  if (outcome != Outcome::kStoreUnreachable && outcome != Outcome::kNotStored) return error;
  const auto report = ask(
      usual_end(), [](auto& client, const auto& options) { return client.report({}, options); });
  if (report) error.why = printable(text_of((*report)->storage_trouble()), kTroubleShownMax);
  return error;
}

// The client, bound on first use and again after a call without a reply, as the registry may have
// moved to another of its addresses. Concurrent first callers bind in parallel, so that none waits
// for another one's deadline.
expected<std::shared_ptr<NamesClient>, DirectoryError> Service::bound_client(
    Registry& registry, MonotonicTime deadline) {
  {
    const std::lock_guard lock(mutex_);
    if (registry.client) return registry.client;
  }
  // A name would recurse into the node's resolver.
  if (!wire::parse_url(registry.url)) {
    return unexpected{DirectoryError{
        {"'" + registry.url + "' is no URL of a registry",
         {},
         "give --registry rtpm://host:port/path, such as " + std::string(kDefaultRegistryUrl)}}};
  }
  auto client = NamesClient::bind(node_, registry.url, {.deadline = deadline - rt::now()});
  if (!client) return unexpected{no_answer(registry.url, client.error())};
  const std::lock_guard lock(mutex_);
  if (!registry.client) registry.client = std::make_shared<NamesClient>(std::move(*client));
  return registry.client;
}

// Makes the next operation retry the registry's addresses.
void Service::forget(Registry& registry, const std::shared_ptr<NamesClient>& client) {
  const std::lock_guard lock(mutex_);
  if (registry.client == client) registry.client = nullptr;
}

expected<Granted, DirectoryError> Service::bind(const Claim& claim, bool replaces) {
  Request request;
  const OwnerId owner = id_of(claim.owner);
  const auto name = request.text(claim.name);
  const auto url = request.text(claim.url);
  const auto interface = request.text(claim.interface);
  const auto properties = write_properties(request.builder, claim.properties);
  const ConstBytes bytes = request.finished(CreateOfferRequest(
      request.builder, name, url, interface, &owner, ns_of(claim.lease), replaces,
      claim.holder_revision, claim.allows_takeover, properties, claim.is_permanent));
  const auto reply = ask(usual_end(), [&](auto& client, const auto& options) {
    return client.offer_encoded(bytes, options);
  });
  if (!reply) return unexpected{reply.error()};
  const BindReply& answer = **reply;
  if (outcome_of(*answer.answer()) == Outcome::kDone) {
    return Granted{.lease = duration_of(answer.lease_ns()), .revision = answer.revision()};
  }
  DirectoryError error = refused(*answer.answer(), claim.name);
  error.holder_url = text_of(answer.holder_url());
  error.holder_lease_left = duration_of(answer.holder_lease_left_ns());
  error.holder_revision = answer.holder_revision();
  if (!error.holder_url.empty()) error.why = "it leads to " + error.holder_url;
  return unexpected{std::move(error)};
}

expected<void, DirectoryError> Service::renew(std::string_view name, Owner owner, Duration lease,
                                              Duration deadline) {
  Request request;
  const OwnerId id = id_of(owner);
  const ConstBytes bytes =
      request.finished(CreateRenewRequest(request.builder, request.text(name), &id, ns_of(lease)));
  return confirm(
      rt::now() + std::min(deadline, deadline_), name,
      [&](auto& client, const auto& options) { return client.renew_encoded(bytes, options); });
}

expected<void, DirectoryError> Service::unbind(std::string_view name, Owner owner,
                                               std::uint64_t holder_revision) {
  Request request;
  const OwnerId id = id_of(owner);
  const ConstBytes bytes = request.finished(
      CreateUnbindRequest(request.builder, request.text(name), &id, holder_revision));
  return confirm(usual_end(), name, [&](auto& client, const auto& options) {
    return client.unbind_encoded(bytes, options);
  });
}

expected<NameEntry, DirectoryError> Service::look_up(std::string_view name, bool has_properties,
                                                     MonotonicTime deadline) {
  Request request;
  const ConstBytes bytes =
      request.finished(CreateResolveRequest(request.builder, request.text(name)));
  const auto reply = ask(std::min(deadline, usual_end()), [&](auto& client, const auto& options) {
    return has_properties ? client.describe_encoded(bytes, options)
                          : client.resolve_encoded(bytes, options);
  });
  if (!reply) return unexpected{reply.error()};
  const ResolveReply& found = **reply;
  if (outcome_of(*found.answer()) != Outcome::kDone) {
    return unexpected{refused(*found.answer(), name)};
  }
  if (found.entry() == nullptr) {
    return unexpected{DirectoryError{
        {"the registry at " + url_ + " answers without an entry", "it is no RTPM one"}}};
  }
  return entry_of(*found.entry(), found.stale_ns());
}

expected<FoundNames, DirectoryError> Service::find(const NameQuery& query) {
  Request request;
  const auto interface = request.text(query.interface);
  const auto predicate = request.text(query.predicate);
  const auto preference = request.text(query.preference);
  const ConstBytes bytes = request.finished(
      CreateFindRequest(request.builder, interface, predicate, preference, query.limit));
  const auto reply = ask(usual_end(), [&](auto& client, const auto& options) {
    return client.find_encoded(bytes, options);
  });
  if (!reply) return unexpected{reply.error()};
  const FindReply& answer = **reply;
  const Outcome outcome = outcome_of(*answer.answer());
  if (outcome != Outcome::kDone) {
    DirectoryError error = refused(*answer.answer(), query.interface);
    const bool is_text = outcome == Outcome::kBadPredicate || outcome == Outcome::kBadPreference;
    if (is_text) {
      error.text_error = {answer.error_offset(), printable(text_of(answer.error_text()))};
      error.why = error.text_error->what;
    }
    return unexpected{std::move(error)};
  }
  FoundNames found;
  for (flatbuffers::uoffset_t i = 0; answer.entries() != nullptr && i < answer.entries()->size();
       ++i)
    found.entries.push_back(entry_of(*answer.entries()->Get(i), answer.stale_ns()));
  found.stale_for = duration_of(answer.stale_ns());
  found.accepted_count = answer.accepted_count();
  found.note = printable(text_of(answer.note()));
  return found;
}

expected<FoundNames, DirectoryError> Service::contents(std::string_view directory) {
  FoundNames found;
  if (auto read = this->read(directory, kNever, found); !read) return unexpected{read.error()};
  return found;
}

expected<void, DirectoryError> Service::read(std::string_view directory, MonotonicTime deadline,
                                             FoundNames& found) {
  const auto list = [&](NamesClient& client, ConstBytes bytes, const rpc::CallOptions& options) {
    auto page = client.list_encoded(bytes, options);
    if (page) found.stale_for = std::max(found.stale_for, duration_of((*page)->stale_ns()));
    return page;
  };
  auto read = read_pages(directory, deadline, list, [&](const ListReply& page, const Entry& entry) {
    found.entries.push_back(entry_of(entry, page.stale_ns()));
  });
  found.accepted_count = static_cast<std::uint32_t>(found.entries.size());
  return read;
}

expected<void, DirectoryError> Service::read_lapsed(MonotonicTime deadline,
                                                    std::vector<LapsedName>& found) {
  const auto list = [](NamesClient& client, ConstBytes bytes, const rpc::CallOptions& options) {
    return client.lapsed_encoded(bytes, options);
  };
  return read_pages({}, deadline, list, [&](const LapsedReply&, const LapsedEntry& entry) {
    found.push_back({entry.name()->str(), entry.url()->str(), entry.interface()->str(),
                     entry.revision(), duration_of(entry.lapsed_ns()), entry.is_of_other_host(),
                     url_});
  });
}

}  // namespace rtpm::names

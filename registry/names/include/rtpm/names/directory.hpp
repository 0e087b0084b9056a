#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/outcome.hpp"
#include "rtpm/names/property.hpp"
#include "rtpm/predicate/text_error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// A bound name.
struct NameEntry {
  std::string name;
  std::string url;
  std::string interface;
  Duration lease_left{};               ///< Remaining lease at the time of the reply.
  std::uint64_t revision = 0;          ///< Revision of its holder; see Claim::holder_revision.
  std::vector<Property> properties{};  ///< Set only by describe(), find() and watches.
  bool is_permanent = false;           ///< It has no lease: ignore lease_left.
  /// How long ago the registry last heard from the storage that it shares with other registries:
  /// the entry may be out of date by that long; 0 if it is current.
  Duration stale_for{};
  /// The host that bound it, in words; set only by resolve() and describe().
  std::string bound_from{};
  /// Whether it was bound from another host, as far as the registry can tell.
  bool is_of_other_host = false;
  /// The service that has the name, and whether another service has it with another URL. Set only
  /// if name services were searched for, not given by a URL.
  std::string service_url{};
  bool is_duplicate = false;
};

/// The criteria of find(). The grammar is in registry/predicate/README.md:
///
///     {.interface = "rtpm.device.Device",
///      .predicate = "class == 'haptic' and force_newton_max >= 3",
///      .preference = "max force_newton_max"}
struct NameQuery {
  std::string_view interface {};  ///< Any if empty.
  std::string_view predicate{};   ///< Every name if empty.
  std::string_view preference{};  ///< Alphabetical order if empty.
  std::uint32_t limit = 0;        ///< If 0, as many as a reply can hold.
};

/// The result of find(), preferred names first.
struct FoundNames {
  std::vector<NameEntry> entries{};
  std::uint32_t accepted_count = 0;  ///< Includes names beyond the limit.
  /// The properties of the query that no name of the interface has, and similar ones; empty if
  /// there are none.
  std::string note{};
  Duration stale_for{};  ///< See NameEntry.
};

/// Why an operation on the registry failed.
struct DirectoryError : SetupError {
  /// The registry's answer; nullopt if it did not answer: then it is unknown whether it acted.
  std::optional<Outcome> outcome{};
  /// The holder, for kAlreadyBound, kStaleEpoch and kStaleRevision.
  std::string holder_url{};
  Duration holder_lease_left{};
  std::uint64_t holder_revision = 0;
  /// Set for kBadPredicate and kBadPreference: the error's position in the text, and its cause.
  std::optional<predicate::TextError> text_error{};
  /// Several name services have the name, with different URLs.
  bool is_ambiguous = false;
};

/// A client of the registry: one request per operation. If the registry restarts, the next
/// operation reaches it.
///
/// Without a registry's URL, each operation searches for name services (see
/// discovery::parse_scope() for the forms): this host's registry, programs that serve their names
/// themselves, and those on the LAN if the scope includes it. It asks all of them and merges their
/// names. Each gets a quarter of the deadline; a registry gets all of it. bind(), rebind(), renew()
/// and unbind() need a registry: this host's or, without one, the only one found. Names from other
/// hosts that lead to loopback addresses are left out.
/// @ownership refers to its node, which must outlive it
/// @threads  any, concurrently
/// @realtime set-up only
/// @errors   all operations: the registry's URL is invalid; "no registry answers at …"; a refusal;
///           nothing is found. Look-ups also: the name leads to different URLs (is_ambiguous)
class Directory {
 public:
  /// `deadline` bounds each request; list() may take several.
  /// @param where  the registry's URL; several separated by ',', asked in turn; or the scope to
  ///           search for name services
  explicit Directory(rpc::Node& node, std::string where = std::string(kThisHost),
                     Duration deadline = std::chrono::seconds{1});
  Directory(Directory&&) noexcept;
  Directory& operator=(Directory&&) noexcept;
  ~Directory();

  /// Binds a name, or replaces the same owner's binding. A restarted owner on the same host takes
  /// the name at once; on another host it waits for the lease to end.
  /// @errors   kAlreadyBound, kStaleEpoch: held by another · kFull and other limits
  [[nodiscard]] expected<Granted, DirectoryError> bind(const Claim& claim);
  /// Binds like bind(), but can also take the name from another holder if the claim allows it.
  /// @errors   kStaleRevision: the holder is not the one that the claim names
  [[nodiscard]] expected<Granted, DirectoryError> rebind(const Claim& claim);
  /// Extends the lease to `lease` from now.
  /// @errors   kNotFound: bind again · kNotOwner, kStaleEpoch
  [[nodiscard]] expected<void, DirectoryError> renew(std::string_view name, Owner owner,
                                                     Duration lease);
  /// Looks a name up, at the latest by `deadline`.
  /// @errors   kNotFound, kNotADirectory, kIsADirectory
  [[nodiscard]] expected<NameEntry, DirectoryError> resolve(std::string_view name,
                                                            MonotonicTime deadline = kNever);
  /// Resolves like resolve(), and adds the properties.
  [[nodiscard]] expected<NameEntry, DirectoryError> describe(std::string_view name,
                                                             MonotonicTime deadline = kNever);
  /// Finds names by interface and properties. A name that lacks a property which the predicate
  /// needs does not match.
  /// @errors   kBadPredicate, kBadPreference: text_error gives the position
  [[nodiscard]] expected<FoundNames, DirectoryError> find(const NameQuery& query);
  /// The URL that a name stands for, as returned by reachable_url(). A path below a bound name
  /// stands for the object below that name's URL: "lab/arm0/config" is /config below the URL of
  /// "lab/arm0". Ends by `deadline`.
  /// @errors   kNotFound, kIsADirectory; the server only serves its own host
  [[nodiscard]] expected<std::string, DirectoryError> url_of(std::string_view name,
                                                             MonotonicTime deadline = kNever);
  /// The entry of the name itself or, for a path below a bound name, of that bound name. Ends by
  /// `deadline`.
  /// @errors   those of url_of()
  [[nodiscard]] expected<NameEntry, DirectoryError> entry_of(std::string_view name,
                                                             MonotonicTime deadline = kNever);
  /// Unbinds a name of this or an earlier start of the owner; with `holder_revision`, of that
  /// holder, whoever owns it.
  /// @errors   those of renew(); kStaleRevision
  [[nodiscard]] expected<void, DirectoryError> unbind(std::string_view name, Owner owner,
                                                      std::uint64_t holder_revision = 0);
  /// Lists like list(), and also reports whether the registry is out of date, even if nothing is
  /// bound.
  [[nodiscard]] expected<FoundNames, DirectoryError> contents(std::string_view directory = {});
  /// All names equal to `directory` or below it; all names if it is empty.
  [[nodiscard]] expected<std::vector<NameEntry>, DirectoryError> list(
      std::string_view directory = {});

  /// The omissions of the last operation, as sentences: services that did not answer, names that
  /// are unreachable from here.
  [[nodiscard]] std::vector<std::string> notes() const;
  [[nodiscard]] const std::string& where() const noexcept;

 private:
  class Impl;
  [[nodiscard]] expected<NameEntry, DirectoryError> look_up(std::string_view name,
                                                            bool has_properties,
                                                            MonotonicTime deadline);
  std::unique_ptr<Impl> impl_;
};

/// The URL of a target: a URL, or a name that Directory looks up. The error for an unbound name
/// lists similar names.
/// @realtime set-up only
/// @errors   those of Directory::url_of()
[[nodiscard]] expected<std::string, SetupError> url_of(rpc::Node& node, const std::string& where,
                                                       const std::string& target);

/// The text "the registry has had no word from its storage for 3.2 s: what it has may be out of
/// date".
[[nodiscard]] std::string stale_text(Duration stale_for);

/// The owner of names that a server at `url` binds. Successive servers at the same address of a
/// host are one owner with increasing epochs.
/// @realtime set-up only
[[nodiscard]] Owner owner_of(std::string_view url);

}  // namespace rtpm::names

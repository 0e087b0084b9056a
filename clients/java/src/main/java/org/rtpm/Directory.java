package org.rtpm;

import java.net.InetAddress;
import java.net.UnknownHostException;
import java.time.Duration;
import java.util.ArrayList;
import java.util.List;
import org.rtpm.internal.io.ClientLoop;
import rtpm.names.Answer;
import rtpm.names.BindReply;
import rtpm.names.BindRequest;
import rtpm.names.Entry;
import rtpm.names.ListReply;
import rtpm.names.ListRequest;
import rtpm.names.NamesMethods;
import rtpm.names.OutcomeCode;
import rtpm.names.OwnerId;
import rtpm.names.RenewRequest;
import rtpm.names.ResolveReply;
import rtpm.names.ResolveRequest;
import rtpm.names.UnbindRequest;

/**
 * The names that a node's registries know (docs/names.md). Each operation asks one registry after
 * the other until one answers.
 *
 * <p>Threads: any.
 */
public final class Directory implements AutoCloseable {
  private static final int DEFAULT_PORT = 7420;
  /** The object that a registry serves. */
  static final String PATH = "rtpm/names";

  private static final String SCHEME = "rtpm://";

  private final Node node;
  private final List<Address> registries = new ArrayList<>();
  private final List<Binding> bindings = new ArrayList<>();
  /** The registry that answered last. */
  private int current;

  /**
   * Asks the registries of the node's options; without any, those of the environment variable
   * RTPM_REGISTRY, else the one of this host.
   *
   * @throws IllegalArgumentException if one of them is malformed; the message has the forms
   */
  public Directory(Node node) {
    this.node = node;
    List<String> texts = node.options().registries();
    if (texts.isEmpty()) {
      String environment = System.getenv("RTPM_REGISTRY");
      texts = List.of(environment == null || environment.isBlank() ? "127.0.0.1" : environment);
    }
    for (String list : texts) {
      // A comma within a URL separates the hosts of one registry.
      for (String text : list.split(",(?=rtpm://)")) {
        registries.add(registryAt(text));
        bindings.add(null);
      }
    }
  }

  private static Address registryAt(String text) {
    boolean isUrl = text.startsWith(SCHEME);
    String[] parts = (isUrl ? text.substring(SCHEME.length()) : text).split("/", 2);
    String port = parts[0].matches(".*:[0-9]+") ? "" : ":" + DEFAULT_PORT;
    String path = parts.length == 1 ? PATH : isUrl ? parts[1] : "";
    Address address = Address.read(SCHEME + parts[0] + port + "/" + path);
    if (address == null) {
      throw new IllegalArgumentException(
          "'" + Printable.of(text) + "' is no registry. Name one, in RTPM_REGISTRY or "
              + "NodeOptions.withRegistries, as host, host:port, [IPv6]:port or "
              + "rtpm://host:port/" + PATH);
    }
    return address;
  }

  private interface Question<T> {
    T ask(Binding registry, CallOptions options);
  }

  /** A reply, and the registry that gave it. */
  private record Answered<T>(T reply, Address registry) {}

  // Each registry has an equal part of the time that is left.
  private synchronized <T> Answered<T> ask(Duration deadline, Question<T> question) {
    long end = Node.after(deadline);
    RtpmException last = null;
    for (int i = 0; i < registries.size(); ++i) {
      int index = (current + i) % registries.size();
      long left = Math.max(end - ClientLoop.now(), 1_000_000);
      Duration part = Duration.ofNanos(left / (registries.size() - i));
      try {
        Binding registry = bindings.get(index);
        if (registry == null) {
          registry =
              node.bindAddress(registries.get(index), NamesMethods.INTERFACE, part);
          bindings.set(index, registry);
        }
        T answer = question.ask(registry, CallOptions.DEFAULT.withDeadline(part));
        current = index;
        return new Answered<>(answer, registries.get(index));
      } catch (RtpmException e) {
        if (last != null) {
          e.addSuppressed(last);
        }
        last = e;
      }
    }
    throw last;
  }

  /**
   * Looks a name up.
   *
   * @throws NameException if it is not bound, or leads to this host's own addresses elsewhere
   * @throws RtpmException if no registry answered
   */
  public NameEntry resolve(String name) {
    return resolve(name, node.options().deadline());
  }

  /** Looks a name up within a deadline. */
  public NameEntry resolve(String name, Duration deadline) {
    Answered<ResolveReply> answered =
        ask(
            deadline,
            (registry, options) ->
                registry.invoke(NamesMethods.RESOLVE, new ResolveRequest(name), options));
    expectDone(name, answered, answered.reply().answer().outcome(), null);
    return entryOf(answered.reply().entry());
  }

  /**
   * The address of a name, or of an object below one: {@code lab/arm0/config} is served where
   * {@code lab/arm0} is bound.
   *
   * @throws NameException as {@link #resolve(String)} does
   */
  public Address addressOf(String name, Duration deadline) {
    String bound = name;
    while (true) {
      try {
        Address found = resolve(bound, deadline).address();
        String path = found.path() + name.substring(bound.length());
        return new Address(found.hosts(), found.port(), path);
      } catch (NameException e) {
        int slash = bound.lastIndexOf('/');
        if (slash < 0 || !e.outcome().equals(OutcomeCode.NOT_A_DIRECTORY)) {
          throw e;
        }
        bound = bound.substring(0, slash);
      }
    }
  }

  // hp-10: loopback addresses of another host, and this host's own, lead elsewhere.
  private static NameEntry entryOf(Entry entry) {
    Address address = addressOf(entry);
    if (entry.isOfOtherHost()) {
      List<String> hosts = new ArrayList<>();
      for (String host : address.hosts()) {
        if (!isOwn(host)) {
          hosts.add(host);
        }
      }
      if (hosts.isEmpty()) {
        throw new NameException(
            Printable.of(entry.name())
                + ": its server serves its own host only, at "
                + address
                + ". Start it with --host any",
            OutcomeCode.BAD_URL);
      }
      address = new Address(hosts, address.port(), address.path());
    }
    return new NameEntry(
        Printable.of(entry.name()),
        address,
        Printable.of(entry.interface_()),
        entry.revision());
  }

  private static Address addressOf(Entry entry) {
    try {
      return Address.parse(entry.url());
    } catch (IllegalArgumentException e) {
      throw new NameException(
          Printable.of(entry.name()) + ": it leads to no address: " + e.getMessage(),
          OutcomeCode.BAD_URL);
    }
  }

  private static boolean isOwn(String host) {
    try {
      return ClientLoop.isOnHost(InetAddress.getByName(host));
    } catch (UnknownHostException e) {
      return false;
    }
  }

  /**
   * Lists the names at and below a directory, in the order of their bytes.
   *
   * @param directory empty: all
   */
  public List<NameEntry> list(String directory) {
    List<NameEntry> all = new ArrayList<>();
    String after = null;
    while (true) {
      ListRequest request =
          ListRequest.builder()
              .directory(directory.isEmpty() ? null : directory)
              .after(after)
              .build();
      Answered<ListReply> answered =
          ask(
              node.options().deadline(),
              (registry, options) -> registry.invoke(NamesMethods.LIST, request, options));
      ListReply reply = answered.reply();
      expectDone(directory, answered, reply.answer().outcome(), null);
      List<Entry> entries = reply.entries() == null ? List.of() : reply.entries();
      for (Entry entry : entries) {
        all.add(
            new NameEntry(
                Printable.of(entry.name()),
                addressOf(entry),
                Printable.of(entry.interface_()),
                entry.revision()));
        after = entry.name();
      }
      if (reply.isLast() || entries.isEmpty()) {
        return all;
      }
    }
  }

  /**
   * Binds a name for as long as the lease is renewed.
   *
   * @return the granted lease, which may be shorter
   * @throws NameException if the registry refuses it, for example as another server has the name
   */
  Duration bind(String name, Address address, String interfaceName, OwnerId owner, Duration lease) {
    BindRequest request =
        BindRequest.builder()
            .name(name)
            .url(address.toString())
            .interface_(interfaceName)
            .owner(owner)
            .leaseNs(lease.toNanos())
            .build();
    Answered<BindReply> answered =
        ask(
            node.options().deadline(),
            (registry, options) -> registry.invoke(NamesMethods.BIND, request, options));
    BindReply reply = answered.reply();
    expectDone(name, answered, reply.answer().outcome(), reply.holderUrl());
    return Duration.ofNanos(reply.leaseNs());
  }

  /** Renews the lease; false if the name is not bound any more. */
  boolean renew(String name, OwnerId owner, Duration lease) {
    RenewRequest request = new RenewRequest(name, owner, lease.toNanos());
    Answered<Answer> answered =
        ask(
            node.options().deadline(),
            (registry, options) -> registry.invoke(NamesMethods.RENEW, request, options));
    return answered.reply().outcome().equals(OutcomeCode.DONE);
  }

  /** Removes the own name. */
  void unbind(String name, OwnerId owner) {
    UnbindRequest request = UnbindRequest.builder().name(name).owner(owner).build();
    ask(
        node.options().deadline(),
        (registry, options) -> registry.invoke(NamesMethods.UNBIND, request, options));
  }

  private static void expectDone(
      String name, Answered<?> answered, OutcomeCode outcome, String holder) {
    if (!outcome.equals(OutcomeCode.DONE)) {
      String registry = "the registry at " + answered.registry().authority();
      String reason = reason(registry, outcome, holder);
      throw new NameException("'" + Printable.of(name) + "': " + reason, outcome);
    }
  }

  private static String reason(String registry, OutcomeCode outcome, String holder) {
    if (outcome.equals(OutcomeCode.NOT_FOUND)) {
      return "no server has bound this name, says " + registry
          + ". node.directory().list(\"\") and `rtpm list` show those that are bound";
    }
    if (outcome.equals(OutcomeCode.BAD_NAME)) {
      return "this is no name. A name has 1 to 8 components of letters, digits, '.', '_' and '-', "
          + "with single slashes between them, such as lab/arm0; each has at most 64 of these, and "
          + "the whole at most 200 characters";
    }
    if (outcome.equals(OutcomeCode.IS_A_DIRECTORY)) {
      return registry + " has only longer names below this one. "
          + "node.directory().list(\"\") shows them: name one of these";
    }
    if (outcome.equals(OutcomeCode.ALREADY_BOUND) && holder != null) {
      return "another server has this name: " + Printable.of(holder);
    }
    return registry + " answers " + outcome;
  }

  /** Gives the bindings to the registries up. */
  @Override
  public synchronized void close() {
    for (int i = 0; i < bindings.size(); ++i) {
      if (bindings.get(i) != null) {
        bindings.get(i).close();
        bindings.set(i, null);
      }
    }
  }
}

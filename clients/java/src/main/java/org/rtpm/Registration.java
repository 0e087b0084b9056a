package org.rtpm;

import java.security.SecureRandom;
import java.time.Duration;
import java.util.concurrent.Executors;
import java.util.concurrent.ScheduledExecutorService;
import java.util.concurrent.TimeUnit;
import rtpm.names.OwnerId;

/**
 * Keeps the name of a server's object bound: renews its lease, and binds it again when the registry
 * was restarted.
 *
 * <p>Threads: any.
 */
public final class Registration implements AutoCloseable {
  /** The usual lease. */
  private static final Duration LEASE = Duration.ofSeconds(2);
  private static final SecureRandom RANDOM = new SecureRandom();

  private final Directory directory;
  private final String name;
  private final Address address;
  private final String interfaceName;
  private final Duration lease;
  private final OwnerId owner = new OwnerId(RANDOM.nextLong(), System.currentTimeMillis());
  private final ScheduledExecutorService renewer =
      Executors.newSingleThreadScheduledExecutor(
          task -> {
            Thread thread = new Thread(task, "rtpm-registration");
            thread.setDaemon(true);
            return thread;
          });
  private volatile String trouble = "";

  private Registration(
      Directory directory,
      String name,
      Address address,
      String interfaceName,
      Duration lease) {
    this.directory = directory;
    this.name = name;
    this.address = address;
    this.interfaceName = interfaceName;
    this.lease = lease;
  }

  /** Binds a name with a lease of 2 seconds, and keeps it until this is closed. */
  public static Registration create(
      Node node, String name, Address address, String interfaceName) {
    return create(node, name, address, interfaceName, LEASE);
  }

  /**
   * Binds a name, and keeps it until this is closed.
   *
   * @param address of the object, as {@link Server#address} tells it
   * @param interfaceName of the object, such as {@code lab.Arm}
   * @param lease for how long the name stays bound when this program ends without closing this; the
   *     registry may grant less
   * @throws NameException if the registry refuses it, for example as another server has the name
   * @throws RtpmException if no registry answers
   */
  public static Registration create(
      Node node, String name, Address address, String interfaceName, Duration lease) {
    Registration created =
        new Registration(node.directory(), name, address, interfaceName, lease);
    Duration granted;
    try {
      granted = created.bind();
    } catch (RuntimeException e) {
      created.renewer.shutdownNow();
      throw e;
    }
    long interval = Math.max(granted.toMillis() / 3, 10);
    created.renewer.scheduleWithFixedDelay(
        created::renew, interval, interval, TimeUnit.MILLISECONDS);
    return created;
  }

  private Duration bind() {
    return directory.bind(name, address, interfaceName, owner, lease);
  }

  private void renew() {
    try {
      if (!directory.renew(name, owner, lease)) {
        bind();
      }
      trouble = "";
    } catch (RtpmException | NameException e) {
      // It is tried again soon: the registry may be restarting.
      trouble = e.getMessage();
    }
  }

  /** Why the name is not bound now; empty if it is. */
  public String trouble() {
    return trouble;
  }

  /** Unbinds the name. */
  @Override
  public void close() {
    renewer.shutdownNow();
    try {
      renewer.awaitTermination(1, TimeUnit.SECONDS);
      directory.unbind(name, owner);
    } catch (RtpmException | IllegalStateException e) {
      // Then the lease ends by itself.
      trouble = e.getMessage();
    } catch (InterruptedException e) {
      Thread.currentThread().interrupt();
    }
  }
}

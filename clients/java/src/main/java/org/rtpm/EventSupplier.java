package org.rtpm;

import java.security.SecureRandom;
import java.util.HashMap;
import java.util.Map;
import java.util.stream.Stream;
import org.rtpm.internal.io.ClientLoop;
import org.rtpm.internal.wire.ClockDomain;
import org.rtpm.values.EventType;
import rtpm.events.AttendReply;
import rtpm.events.AttendRequest;
import rtpm.events.HubClient;
import rtpm.events.HubFacts;
import rtpm.events.HubMethods;
import rtpm.events.PushRequest;
import rtpm.events.SupplierCounts;

/**
 * Pushes events to a hub. An event is a oneway: it may get lost, and nothing waits for it.
 *
 * <p>Threads: any.
 */
public final class EventSupplier implements AutoCloseable {
  private static final SecureRandom RANDOM = new SecureRandom();
  private static final long MILLISECOND = 1_000_000;

  private final Binding binding;
  private final HubClient hub;
  private final long number = RANDOM.nextLong();
  private final Map<Long, Long> sequences = new HashMap<>();
  /** The hub's clock minus this program's. */
  private final long clockOffsetNs;
  private final long uncertaintyNs;
  private final AttendRequest attendance;

  private EventSupplier(Binding binding, String name, EventType<?>... types) {
    this.binding = binding;
    hub = new HubClient(binding);
    long before = ClientLoop.now();
    HubFacts facts = Node.await(hub.about());
    long after = ClientLoop.now();
    long domain = ClockDomain.ofThisProgram();
    boolean isOneClock = domain != 0 && domain == facts.clockDomain();
    clockOffsetNs = isOneClock ? 0 : facts.timeNs() - (before + (after - before) / 2);
    uncertaintyNs = isOneClock ? 0 : (after - before) / 2 + MILLISECOND;
    attendance =
        AttendRequest.builder()
            .supplier(number)
            .name(name)
            .types(Stream.of(types).map(EventFilter::entryOf).toList())
            .build();
  }

  /**
   * Binds a hub, and tells it the types.
   *
   * @param hub its name, usually {@code rtpm/events}, or its address
   * @param name of the supplier, for the hub's report
   * @throws RtpmException if the hub can't be bound
   * @throws NameException if its name is not bound
   * @throws IllegalArgumentException if the hub refuses a type; the message says why
   */
  public static EventSupplier open(Node node, String hub, String name, EventType<?>... types) {
    Binding binding = node.bind(hub, HubMethods.INTERFACE);
    try {
      EventSupplier opened = new EventSupplier(binding, name, types);
      opened.attend();
      return opened;
    } catch (RuntimeException e) {
      binding.close();
      throw e;
    }
  }

  private AttendReply attend() {
    AttendReply reply = Node.await(hub.attend(attendance));
    if (reply.refusal() != null && !reply.refusal().isEmpty()) {
      throw new IllegalArgumentException(
          binding.address() + " refuses the types: " + Printable.of(reply.refusal()));
    }
    return reply;
  }

  /**
   * Pushes an event that happens now.
   *
   * @param source tells the suppliers of one type apart
   * @throws CallException if it does not fit one frame: 1344 bytes over UDP, 64 KiB over TCP
   */
  public <T> void push(EventType<T> type, int source, T value) {
    byte[] payload = type.codec().encode(value);
    byte[] bytes =
        EventBytes.write(
            type.type(),
            source,
            nextSequence(type.type(), source),
            ClientLoop.now() + clockOffsetNs,
            uncertaintyNs,
            type.schemaId(),
            payload);
    hub.push(new PushRequest(number, bytes));
  }

  private synchronized long nextSequence(int type, int source) {
    long key = (long) type << 32 | Integer.toUnsignedLong(source);
    return sequences.merge(key, 1L, Long::sum);
  }

  /** The hub's counts of this supplier's events. Also tells a restarted hub the types again. */
  public SupplierCounts counts() {
    return attend().counts();
  }

  /** Gives the hub up. */
  @Override
  public void close() {
    binding.close();
  }
}

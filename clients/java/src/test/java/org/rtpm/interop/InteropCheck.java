package org.rtpm.interop;

import java.time.Duration;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Random;
import java.util.concurrent.BlockingQueue;
import java.util.concurrent.CancellationException;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.ExecutionException;
import java.util.concurrent.ExecutorService;
import java.util.concurrent.Executors;
import java.util.concurrent.Future;
import java.util.concurrent.LinkedBlockingQueue;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.TimeoutException;
import org.rtpm.Address;
import org.rtpm.BindException;
import org.rtpm.CallException;
import org.rtpm.CallOptions;
import org.rtpm.Device;
import org.rtpm.DeviceException;
import org.rtpm.DeviceLease;
import org.rtpm.Event;
import org.rtpm.EventConsumer;
import org.rtpm.EventFilter;
import org.rtpm.NameException;
import org.rtpm.Node;
import org.rtpm.NodeOptions;
import org.rtpm.PrivateKey;
import org.rtpm.Registration;
import org.rtpm.Status;
import org.rtpm.Transport;
import org.rtpm.WasRun;
import org.rtpm.values.Interface;
import rtpm.device.OutcomeCode;
import rtpm.device.Sample;
import rtpm.device.Vector3;
import rtpm.interop.Bytes;
import rtpm.interop.Color;
import rtpm.interop.Count;
import rtpm.interop.Emission;
import rtpm.interop.InteropClient;
import rtpm.interop.InteropMethods;
import rtpm.interop.Item;
import rtpm.interop.Leaf;
import rtpm.interop.Measured;
import rtpm.interop.Note;
import rtpm.interop.Numbers;
import rtpm.interop.Pause;
import rtpm.interop.Pausing;
import rtpm.interop.Range;
import rtpm.interop.Reason;
import rtpm.interop.Refusal;
import rtpm.interop.Shape;
import rtpm.interop.Values;
import rtpm.interop.Vector;

/** Checks a server of interop.fbs, case by case. */
final class InteropCheck {
  private static final int CASE_SECONDS = 20;
  private static final String WORDS = "größer als 5";

  /** A case that can't pass. */
  private static final class NoPass extends RuntimeException {
    private static final long serialVersionUID = 1L;
    private final String result;

    NoPass(String result, String detail) {
      super(detail, null, false, false);
      this.result = result;
    }
  }

  private interface Case {
    void run() throws Exception;
  }

  private final String url;
  private final Interop.Options options;
  private final boolean isLossy;
  private final PrivateKey key;
  private final Map<String, Case> cases = new LinkedHashMap<>();
  private final Random random = new Random();
  private Node node;
  private InteropClient client;
  private Future<Void> keeping;

  InteropCheck(String url, Interop.Options options) throws java.io.IOException {
    this.url = url;
    this.options = options;
    isLossy = options.flags().contains("--lossy");
    key = options.key();
    cases.put("numbers", this::numbers);
    cases.put("values", this::values);
    cases.put("range", this::range);
    cases.put("large", this::large);
    cases.put("too_large", this::tooLarge);
    cases.put("refusals", this::refusals);
    cases.put("no_such_object", this::noSuchObject);
    cases.put("wrong_interface", this::wrongInterface);
    cases.put("deadline", this::deadline);
    cases.put("cancel", this::cancel);
    cases.put("expired", this::expired);
    cases.put("at_most_once", this::atMostOnce);
    cases.put("concurrent", this::concurrent);
    cases.put("oneways", this::oneways);
    cases.put("priority", this::priority);
    cases.put("stream", this::stream);
    cases.put("slow_reader", this::slowReader);
    cases.put("stream_cancel", this::streamCancel);
    cases.put("stream_failure", this::streamFailure);
    cases.put("events", this::events);
    cases.put("name", this::name);
    cases.put("device", this::device);
  }

  /** Runs all cases; false if one failed. */
  boolean run() throws InterruptedException {
    boolean isGood = true;
    ExecutorService runner =
        Executors.newCachedThreadPool(
            task -> {
              Thread thread = new Thread(task, "interop-case");
              thread.setDaemon(true);
              return thread;
            });
    if (options.get("--registry") != null && options.get("--name") != null) {
      // Beside the other cases, as it takes long.
      keeping =
          runner.submit(
              () -> {
                keepOwnName();
                return null;
              });
    }
    for (Map.Entry<String, Case> each : cases.entrySet()) {
      String result = "pass";
      String detail = "";
      Future<Void> run =
          runner.submit(
              () -> {
                bind();
                each.getValue().run();
                return null;
              });
      try {
        run.get(CASE_SECONDS, TimeUnit.SECONDS);
      } catch (TimeoutException e) {
        run.cancel(true);
        result = "fail";
        detail = "not done after " + CASE_SECONDS + " s";
      } catch (ExecutionException e) {
        result = e.getCause() instanceof NoPass noPass ? noPass.result : "fail";
        detail =
            e.getCause() instanceof NoPass ? e.getCause().getMessage() : e.getCause().toString();
      }
      isGood &= !result.equals("fail");
      System.out.println(
          "{\"case\": \"" + each.getKey() + "\", \"result\": \"" + result + "\", \"detail\": \""
              + escaped(detail) + "\"}");
    }
    return isGood;
  }

  private static String escaped(String text) {
    StringBuilder to = new StringBuilder();
    for (char c : text.toCharArray()) {
      if (c == '"' || c == '\\') {
        to.append('\\').append(c);
      } else if (c < ' ' || c > '~') {
        to.append(String.format("\\u%04x", (int) c));
      } else {
        to.append(c);
      }
    }
    return to.toString();
  }

  // ---- helpers ----------------------------------------------------------------------------------

  private NodeOptions how() {
    NodeOptions how = NodeOptions.DEFAULT.withDeadline(Duration.ofSeconds(5));
    return options.get("--registry") == null ? how : how.withRegistries(options.get("--registry"));
  }

  /** The options of a node that calls a server of interop.fbs. */
  private NodeOptions howTo(Address server) {
    return key == null
        ? how()
        : how().withServerKey(key, server.authority(), options.publicKey("--server-key"));
  }

  // The first case opens the node, and so has the fault of a server that can't be reached.
  private void bind() {
    if (client == null) {
      if (node == null) {
        node = Node.open(howTo(Address.parse(url)).withTransport(options.transport()));
      }
      client = new InteropClient(node.bind(url, InteropMethods.INTERFACE));
    }
  }

  private static void expect(boolean isSo, String detail) {
    if (!isSo) {
      throw new NoPass("fail", detail);
    }
  }

  private static <T> void expectEqual(T expected, T got, String what) {
    expect(expected.equals(got), what + ": expected " + expected + ", got " + got);
  }

  private static CallException failureOf(CompletableFuture<?> call) {
    try {
      Object result = Node.await(call);
      throw new NoPass("fail", "the call did not fail, but gave " + result);
    } catch (CallException e) {
      return e;
    }
  }

  private static boolean has(CallException failure, Status status) {
    return failure.status().orElse(null) == status;
  }

  private static CallOptions within(int milliseconds) {
    return CallOptions.DEFAULT.withDeadline(Duration.ofMillis(milliseconds));
  }

  private long sum() {
    return Node.await(client.add(new Count(0))).count();
  }

  private static long millisecondsSince(long begin) {
    return TimeUnit.NANOSECONDS.toMillis(System.nanoTime() - begin);
  }

  private String word() {
    return "interop-" + Long.toHexString(random.nextLong());
  }

  private String given(String name) {
    if (options.get(name) == null) {
      throw new NoPass("skipped", "needs " + name);
    }
    return options.get(name);
  }

  // ---- values -----------------------------------------------------------------------------------

  private static Numbers numbersOf(
      boolean isHigh, float f32, double f64, Color color, Vector at, int[] three) {
    return isHigh
        ? new Numbers(
            127, 255, 32767, 65535, Integer.MAX_VALUE, 0xffff_ffffL, Long.MAX_VALUE, -1L, f32, f64,
            true, color, at, three)
        : new Numbers(
            -128, 0, -32768, 0, Integer.MIN_VALUE, 0, Long.MIN_VALUE, 0, f32, f64, false, color,
            at, three);
  }

  private void numbers() {
    double infinity = Double.POSITIVE_INFINITY;
    List<Numbers> all =
        List.of(
            numbersOf(
                false, -Float.MAX_VALUE, -Double.MAX_VALUE, Color.RED,
                new Vector(-Double.MAX_VALUE, Double.MIN_VALUE, 0), new int[] {0, 0, 0}),
            numbersOf(
                true, Float.MAX_VALUE, Double.MAX_VALUE, Color.BLUE,
                new Vector(Double.MAX_VALUE, 1, 1e-300), new int[] {65535, 65535, 65535}),
            numbersOf(
                true, Float.NaN, Double.NaN, Color.GREEN,
                new Vector(Double.NaN, infinity, -infinity), new int[] {1, 2, 3}),
            numbersOf(
                false, -0.0f, -0.0, Color.GREEN, new Vector(-0.0, 0.0, 1), new int[] {0, 256, 1}),
            numbersOf(
                true, Float.POSITIVE_INFINITY, infinity, Color.RED, new Vector(0, 0, 0),
                new int[] {32768, 32767, 255}),
            numbersOf(
                false, Float.NEGATIVE_INFINITY, -infinity, Color.RED, new Vector(0, 0, 0),
                new int[] {7, 8, 9}),
            new Numbers(
                -1, 128, -2, 32768, 305_419_896, 0x8000_0000L, -3, 0x1234_5678_9abc_def0L, 1.5f,
                0.1, true, Color.BLUE, new Vector(1, -2, 3.5), new int[] {4660, 22136, 1}));
    for (Numbers each : all) {
      // Equality of records takes all NaN for equal, and -0 for another number than 0.
      expectEqual(each, Node.await(client.echoNumbers(each)), "numbers");
    }
  }

  private static Values fullValues(Shape shape) {
    double[] reals = new double[100];
    Arrays.setAll(reals, i -> i * 0.1 - 3);
    return Values.builder()
        .text("naïve 触覚 🖐")
        .absent("present")
        .texts(List.of("", "one", "naïve 触覚 🖐"))
        .reals(reals)
        .bytes(new byte[] {0, 1, -1, 127, -128})
        .longs(new long[] {-1L, 0, Long.MIN_VALUE})
        .vectors(List.of(new Vector(1, 2, 3), new Vector(-0.0, 1e300, -1)))
        .leaves(List.of(new Leaf("a", null), new Leaf("", 0f), new Leaf("c", -1.5f)))
        .colors(List.of(Color.RED, Color.GREEN, Color.BLUE))
        .shape(shape)
        .color(Color.BLUE)
        .level(42)
        .maybe(0L)
        .newton(-20)
        .build();
  }

  private void values() {
    Values leaf = fullValues(new Shape.Leaf(new Leaf("leaf", 0.5f)));
    expectEqual(leaf, Node.await(client.echoValues(leaf)), "full");
    Values corner = fullValues(new Shape.Corner(new Vector(4, 5, 6)));
    expectEqual(corner, Node.await(client.echoValues(corner)), "full");
    Values greatest = fullValues(null).toBuilder().maybe(-1L).text("").build();
    expectEqual(greatest, Node.await(client.echoValues(greatest)), "full");
    Values bare = Values.builder().text("alone").build();
    Values got = Node.await(client.echoValues(bare));
    expectEqual(bare, got, "bare");
    expect(got.shape() == null && got.maybe() == null, "something absent is present");
    expectEqual(Color.GREEN, got.color(), "color");
    expectEqual(-3, got.level(), "level");
    expectEqual(0.0, got.newton(), "newton");
  }

  private void range() {
    Values good = Values.builder().text("").newton(20).build();
    expectEqual(good, Node.await(client.echoValues(good)), "20 newton");
    CallException failure = failureOf(client.echoValues(good.toBuilder().newton(20.5).build()));
    expect(has(failure, Status.BAD_REQUEST), failure.getMessage());
    expectEqual(WasRun.NO, failure.wasRun(), "was run");
  }

  private static byte[] bytes(int size) {
    byte[] bytes = new byte[size];
    for (int i = 0; i < size; ++i) {
      bytes[i] = (byte) (i * 31 + i / 256);
    }
    return bytes;
  }

  private void echo(int size) {
    byte[] sent = bytes(size);
    byte[] got = Node.await(client.echoBytes(new Bytes(sent))).bytes();
    expect(Arrays.equals(sent, got), size + " bytes came back changed");
  }

  private void large() {
    for (int size : new int[] {0, 1, 1400, 1_048_576}) {
      echo(size);
    }
  }

  private void tooLarge() {
    CallException failure = failureOf(client.echoBytes(new Bytes(bytes(1_100_001))));
    expect(has(failure, Status.TOO_LARGE), failure.getMessage());
    echo(1);
  }

  // ---- failures ---------------------------------------------------------------------------------

  private void refusals() {
    Map<Reason, Status> statuses = new HashMap<>();
    statuses.put(Reason.BAD_REQUEST, Status.BAD_REQUEST);
    statuses.put(Reason.NOT_LEASE_HOLDER, Status.NOT_LEASE_HOLDER);
    statuses.put(Reason.GONE, Status.GONE);
    statuses.put(Reason.SERVANT_FAILED, Status.SERVANT_FAILED);
    statuses.forEach(
        (reason, status) -> {
          CallException failure = failureOf(client.refuse(new Refusal(reason, WORDS)));
          expect(has(failure, status), reason + ": " + failure.getMessage());
          boolean isFailed = status == Status.SERVANT_FAILED;
          expectEqual(isFailed ? WasRun.YES : WasRun.NO, failure.wasRun(), reason + ": was run");
          if (isFailed || status == Status.BAD_REQUEST) {
            expectEqual(WORDS, failure.text(), reason + ": text");
          }
        });
  }

  private void expectUnbound(String path, Interface description, String words) {
    String other = url.replaceFirst("/interop$", "/" + path);
    try {
      node.bind(other, description, Duration.ofSeconds(5)).close();
    } catch (BindException e) {
      expect(e.getMessage().contains(words), e.getMessage());
      return;
    }
    throw new NoPass("fail", other + " was bound");
  }

  private void noSuchObject() {
    expectUnbound("interop/nothing", InteropMethods.INTERFACE, "has no object interop/nothing");
  }

  private void wrongInterface() {
    expectUnbound("interop/other", InteropMethods.INTERFACE, "is a rtpm.interop.Other");
  }

  private void deadline() {
    long begin = System.nanoTime();
    CallException failure = failureOf(client.wait_(new Pause(500), within(100)));
    long took = millisecondsSince(begin);
    expect(isLate(failure) || has(failure, Status.CANCELLED), failure.getMessage());
    expect(took >= 50 && took <= 450, "it took " + took + " ms");
    sum();
  }

  private static boolean isLate(CallException failure) {
    return failure.status().isEmpty() || has(failure, Status.EXPIRED);
  }

  private void cancel() throws InterruptedException {
    CompletableFuture<Void> call = client.wait_(new Pause(isLossy ? 300 : 3000));
    Thread.sleep(50);
    long begin = System.nanoTime();
    call.cancel(false);
    try {
      Node.await(call);
      throw new NoPass("fail", "the call was not cancelled");
    } catch (CancellationException e) {
      long took = millisecondsSince(begin);
      expect(took <= 500, "it took " + took + " ms");
    }
    if (isLossy) {
      Thread.sleep(300); // A CANCEL that is lost leaves the call its place.
    }
    sum();
  }

  private void expired() throws InterruptedException {
    if (isLossy) {
      throw new NoPass("skipped", "add may come before hold");
    }
    long before = sum();
    CompletableFuture<Pausing> hold = client.hold(new Pause(400));
    Thread.sleep(50);
    CallException failure = null;
    try {
      Node.await(client.add(new Count(1), within(100)));
    } catch (CallException e) {
      failure = e;
    }
    if (!Node.await(hold).wasAlone()) {
      throw new NoPass("not_offered", "the server ran another call meanwhile");
    }
    expect(failure != null, "add was not late, though hold was alone");
    expect(isLate(failure), failure.getMessage());
    expectEqual(before, sum(), "sum");
  }

  // ---- runs -------------------------------------------------------------------------------------

  private void atMostOnce() {
    long before = sum();
    for (int i = 1; i <= 100; ++i) {
      expectEqual(before + i, Node.await(client.add(new Count(1))).count(), "sum");
    }
  }

  private void concurrent() {
    List<CompletableFuture<Values>> calls = new ArrayList<>();
    for (int i = 0; i < 32; ++i) {
      calls.add(client.echoValues(Values.builder().text("call " + i).build()));
    }
    for (int i = 0; i < calls.size(); ++i) {
      expectEqual("call " + i, Node.await(calls.get(i)).text(), "text");
    }
  }

  private void oneways() throws InterruptedException {
    long before = Node.await(client.notes()).count();
    for (int i = 0; i < 10; ++i) {
      client.noteSent(new Note(i));
      Node.await(client.noteReceived(new Note(i)));
      Node.await(client.noteDone(new Note(i)));
    }
    int least = isLossy ? 20 : 30;
    long end = System.nanoTime() + TimeUnit.SECONDS.toNanos(2);
    long rise = 0;
    while (rise < least && System.nanoTime() < end) {
      rise = Node.await(client.notes()).count() - before;
      Thread.sleep(5);
    }
    expect(rise >= least && rise <= 30, rise + " of 30 were noted");
  }

  private void priority() {
    for (int priority : new int[] {0, 50}) {
      CallOptions at = CallOptions.DEFAULT.withPriority(priority);
      expectEqual(priority, Node.await(client.priority(at)).priority(), "priority");
    }
  }

  // ---- streams ----------------------------------------------------------------------------------

  private StreamReader count(long count, long padding, String failure, int window) {
    StreamReader reader = new StreamReader(window);
    client.countUp(new Range(count, padding, failure)).subscribe(reader);
    return reader;
  }

  private void expectItems(StreamReader reader, int count, int padding)
      throws InterruptedException {
    for (int i = 0; i < count; ++i) {
      Item item = reader.next();
      expectEqual((long) i, item.number(), "item");
      expectEqual(padding, item.padding().length, "padding");
    }
  }

  private void stream() throws InterruptedException {
    StreamReader reader = count(2000, 0, null, 16);
    expectItems(reader, 2000, 0);
    reader.expectEnd();
  }

  private void slowReader() throws InterruptedException {
    StreamReader reader = count(3000, 1000, null, 1);
    for (int i = 0; i < 3000; ++i) {
      Item item = reader.next();
      expectEqual((long) i, item.number(), "item");
      expectEqual(1000, item.padding().length, "padding");
      if (i < 5) {
        Thread.sleep(100);
      }
    }
    reader.expectEnd();
  }

  private void streamCancel() throws InterruptedException {
    StreamReader reader = count(0, 0, null, 16);
    expectItems(reader, 6, 0);
    reader.cancel();
    long end = System.nanoTime() + TimeUnit.SECONDS.toNanos(2);
    while (Node.await(client.streams()).count() != 0) {
      if (isLossy) {
        return; // A CANCEL that is lost has no effect but later.
      }
      expect(System.nanoTime() < end, "the stream runs on");
      Thread.sleep(10);
    }
  }

  private void streamFailure() throws InterruptedException {
    StreamReader reader = count(3, 0, WORDS, 16);
    expectItems(reader, 3, 0);
    CallException failure = reader.failure();
    expect(has(failure, Status.SERVANT_FAILED), failure.getMessage());
    expect(
        failure.text().isEmpty() || failure.text().equals(WORDS),
        "another text: " + failure.text());
  }

  // ---- the laboratory ---------------------------------------------------------------------------

  // Always over TCP, where no event gets lost.
  private Node laboratory() {
    given("--registry");
    return Node.open(how().withTransport(Transport.TCP));
  }

  private void events() throws InterruptedException {
    String text = word();
    BlockingQueue<Integer> levels = new LinkedBlockingQueue<>();
    EventFilter filter =
        EventFilter.where(
            Measured.EVENT, "level", EventFilter.Comparison.GREATER_OR_EQUAL, 5);
    try (Node lab = laboratory();
        EventConsumer consumer =
            EventConsumer.open(
                lab, "rtpm/events", "interop", filter, event -> keep(event, text, levels))) {
      expectEqual("", consumer.trouble(), "trouble");
      Node.await(client.emit(new Emission(0, 10, text), within(10_000)));
      for (int level = 5; level < 10; ++level) {
        expectEqual(level, levels.poll(5, TimeUnit.SECONDS), "level");
      }
      Integer more = levels.poll(100, TimeUnit.MILLISECONDS);
      expect(more == null, "another event came, of level " + more);
    }
  }

  private static void keep(Event event, String text, BlockingQueue<Integer> levels) {
    Measured measured = event.value(Measured.EVENT);
    if (measured.text().equals(text)) {
      levels.add(measured.level());
    }
  }

  private void name() throws Exception {
    String name = given("--name");
    try (Node lab = laboratory()) {
      // Its server's address by TCP, so not always the one that is checked.
      Address server = lab.directory().resolve(name).address();
      try (Node following = Node.open(howTo(server).withTransport(Transport.TCP))) {
        Node.await(
            new InteropClient(following.bind(name, InteropMethods.INTERFACE)).add(new Count(0)));
      }
    }
    try {
      keeping.get();
    } catch (ExecutionException e) {
      throw e.getCause() instanceof Exception cause ? cause : e;
    }
  }

  private void keepOwnName() throws InterruptedException {
    String own = word();
    Address address = Address.parse(url);
    try (Node lab = laboratory()) {
      try (Registration kept =
          Registration.create(
              lab, own, address, InteropMethods.INTERFACE.name(), Duration.ofSeconds(1))) {
        Thread.sleep(2500);
        expectEqual(address, lab.directory().resolve(own).address(), "address");
        expectEqual("", kept.trouble(), "trouble");
      }
      try {
        throw new NoPass("fail", "still bound to " + lab.directory().resolve(own));
      } catch (NameException e) {
        expectEqual(rtpm.names.OutcomeCode.NOT_FOUND, e.outcome(), "outcome");
      }
    }
  }

  private void device() throws InterruptedException {
    String name = given("--device");
    try (Node lab = laboratory();
        Node second = laboratory();
        Device arm = Device.open(lab, name);
        Device same = Device.open(second, name)) {
      try (DeviceLease lease = arm.acquire(Duration.ofSeconds(2))) {
        try {
          same.acquire(Duration.ofNanos(1)).close();
          throw new NoPass("fail", "two sessions got the lease");
        } catch (DeviceException e) {
          expectEqual(OutcomeCode.HELD, e.outcome(), "second acquisition");
        }
        push(arm, lease);
      }
      same.acquire(Duration.ofSeconds(2)).close();
    }
  }

  private static void push(Device arm, DeviceLease lease) throws InterruptedException {
    double most = 0;
    long end = System.nanoTime() + TimeUnit.MILLISECONDS.toNanos(100);
    String fault = "";
    while (System.nanoTime() < end) {
      try {
        lease.force(new Vector3(0, 0, 1), Duration.ofMillis(50));
      } catch (CallException e) {
        // A command has 10 ms, which a busy machine may take for itself.
        fault = e.getMessage();
      }
      Sample sample = arm.read();
      most = Math.max(most, sample.forceNewton().z());
      Thread.sleep(5);
    }
    expect(most > 0.1, "no sample shows a force; " + fault);
  }
}

//! Serves a bus to socketcand clients.
//!
//! One thread owns all connections and waits for none: whatever a client does, the others and the
//! drives behind the bus go on. Each client has a queue of what its connection has not taken yet.
//! One that falls further behind than the queue holds is told so as its last message, and dropped:
//! frames left out in the middle would be worse, for nobody would know of them.

use super::super::PortError;
use super::super::network::{Inlet, NetworkBus, Outlet};
use super::{Messages, TIMEOUT, frame_message, parse_send, resolve};
use crate::realtime::{self, Settings};
use crossbeam::channel::{self, Receiver, Sender, TryRecvError};
use rustix::buffer::spare_capacity;
use rustix::event::epoll::{self, EventData, EventFlags};
use rustix::event::{EventfdFlags, Timespec, eventfd};
use socket2::SockRef;
use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use syncline_canopen::Frame;

/// Where servers announce themselves.
const BEACON_PORT: u16 = 42_000;
/// After `< ok >` to `< rawmode >`, before the first frame.
const PAUSE: Duration = Duration::from_millis(20);
/// Between two tries to accept a connection after one that failed, for want of descriptors.
const ACCEPT_AGAIN: Duration = Duration::from_millis(100);
/// Of the serving thread: below the drives' own.
const PRIORITY: u8 = 40;
/// Bytes that a client may be behind beyond what the kernel keeps for it: 0.5 s of a bus that is
/// full at 1 Mbit/s.
const QUEUE: usize = 1 << 18;
/// Bytes that the kernel keeps for a client.
const SEND_BUFFER: usize = 1 << 17;
/// The last message to a client that is dropped.
const TOO_SLOW: &str = "< error you read too slowly: good-bye >";
/// What the serving thread may be behind: 6 s of a bus that is full at 1 Mbit/s.
const ORDERS: usize = 65_536;
/// How soon to look again where something waits for room in a connection.
const SOON: Duration = Duration::from_millis(5);
/// How soon to look again where nothing waits.
const LATER: Duration = Duration::from_secs(1);
/// Readiness of the wake-up that comes with an [`Order`]; connections count from 1.
const WAKE: u64 = 0;
/// Connections that are looked after in one round.
const READY: usize = 256;

/// Serves a bus named `bus` to any number of socketcand clients. What one client sends reaches
/// the others too.
///
/// # Errors
/// The address cannot be listened on.
pub(in super::super) fn serve(
    name: &str,
    address: &str,
    bus: &str,
) -> Result<NetworkBus, PortError> {
    let fail = |error: io::Error| PortError {
        bus: name.to_owned(),
        what: format!("cannot listen: {error}"),
    };
    let listener = TcpListener::bind(address).map_err(fail)?;
    let name = format!(
        "socketcand://{}/{bus}",
        listener.local_addr().map_err(fail)?
    );
    let (inlet, frames) = NetworkBus::inlet();
    let (tell, notices) = channel::unbounded();
    let (server, orders) = Server::new(bus, inlet, tell).map_err(fail)?;
    let accepted = orders.clone();
    thread::spawn(move || {
        for stream in listener.incoming() {
            match stream {
                Ok(stream) => accepted.give(Order::Attend(stream)),
                Err(_) => thread::sleep(ACCEPT_AGAIN),
            }
        }
    });
    thread::spawn(move || server.serve());
    let bus = NetworkBus::new(name, frames, Box::new(orders));
    Ok(bus.with_notices(notices))
}

/// Announces a served bus on the network of its address, on loopback only to this host.
pub(crate) struct Beacon {
    socket: UdpSocket,
    to: SocketAddr,
    text: String,
}

impl Beacon {
    /// How often it is to be sent.
    pub(crate) const INTERVAL: Duration = Duration::from_secs(3);

    /// The beacon of `bus`, served at `address`.
    ///
    /// # Errors
    /// The address is not one of an IPv4 interface of this host.
    pub(crate) fn new(address: &str, bus: &str) -> Result<Self, PortError> {
        let fail = |what: String| PortError {
            bus: format!("socketcand://{address}/{bus}"),
            what: format!("no beacon: {what}"),
        };
        let served = resolve(address).map_err(|error| fail(error.to_string()))?;
        let to = match served.ip() {
            IpAddr::V4(ip) if ip.is_loopback() => ip,
            IpAddr::V4(ip) if !ip.is_unspecified() => Ipv4Addr::BROADCAST,
            _ => return Err(fail("it tells an IPv4 address: serve on one".to_owned())),
        };
        let socket = UdpSocket::bind((served.ip(), 0))
            .and_then(|socket| socket.set_broadcast(true).map(|()| socket))
            .map_err(|error| fail(error.to_string()))?;
        Ok(Self {
            socket,
            to: (to, BEACON_PORT).into(),
            text: format!(
                "<CANBeacon name=\"syncline\" type=\"SocketCAN\" \
                 description=\"simulated drives\"><URL>can://{served}</URL>\
                 <Bus name=\"{bus}\"/></CANBeacon>"
            ),
        })
    }

    /// Sends it once; nobody listening is no error.
    pub(crate) fn send(&self) {
        let _ = self.socket.send_to(self.text.as_bytes(), self.to);
    }
}

/// What the serving thread is to do.
enum Order {
    /// Speak with a new client.
    Attend(TcpStream),
    /// Send a frame of the drives to all clients.
    Send(Frame),
}

/// The way to the serving thread.
#[derive(Clone)]
struct Orders {
    orders: Sender<Order>,
    wake: Arc<OwnedFd>,
}

impl Orders {
    fn give(&self, order: Order) {
        // The thread ends with the bus only.
        let _ = self.orders.send(order);
        self.wake();
    }

    fn wake(&self) {
        // It fails only where the thread has 2^64 wake-ups to come already.
        let _ = rustix::io::write(&*self.wake, &1_u64.to_ne_bytes());
    }
}

impl Outlet for Orders {
    fn write(&mut self, frames: &[Frame]) -> io::Result<()> {
        for frame in frames.iter().filter(|frame| !frame.is_remote()) {
            // A full channel loses the frame, as a full bus would.
            let _ = self.orders.try_send(Order::Send(*frame));
        }
        self.wake();
        Ok(())
    }
}

/// The serving thread's own.
struct Server {
    bus: String,
    clients: BTreeMap<u64, Client>,
    next: u64,
    orders: Receiver<Order>,
    wake: Arc<OwnedFd>,
    epoll: OwnedFd,
    /// Frames that clients send.
    inlet: Inlet,
    /// What the person who serves is to know.
    tell: Sender<String>,
}

/// A message for all clients but the one that it came from.
struct Broadcast {
    from: Option<u64>,
    message: String,
}

impl Server {
    fn new(bus: &str, inlet: Inlet, tell: Sender<String>) -> io::Result<(Self, Orders)> {
        let wake = Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?);
        let epoll = epoll::create(epoll::CreateFlags::CLOEXEC)?;
        epoll::add(&epoll, &*wake, EventData::new_u64(WAKE), EventFlags::IN)?;
        let (sender, orders) = channel::bounded(ORDERS);
        let server = Self {
            bus: bus.to_owned(),
            clients: BTreeMap::new(),
            next: WAKE + 1,
            orders,
            wake: Arc::clone(&wake),
            epoll,
            inlet,
            tell,
        };
        let orders = Orders {
            orders: sender,
            wake,
        };
        Ok((server, orders))
    }

    /// Speaks with the clients for as long as there is a bus.
    fn serve(mut self) {
        let _granted = realtime::enter(&Settings {
            priority: PRIORITY,
            core: None,
        });
        let mut ready = Vec::with_capacity(READY);
        let mut broadcasts = Vec::new();
        loop {
            self.end_pauses();
            let waits = self.clients.values().any(Client::waits);
            let most = Timespec::try_from(if waits { SOON } else { LATER }).ok();
            ready.clear();
            match epoll::wait(&self.epoll, spare_capacity(&mut ready), most.as_ref()) {
                Ok(_) | Err(rustix::io::Errno::INTR) => {}
                Err(_) => return,
            }
            for event in &ready {
                match event.data.u64() {
                    WAKE => {
                        let _ = rustix::io::read(&*self.wake, &mut [0_u8; 8]);
                    }
                    client => self.hear(client, &mut broadcasts),
                }
            }
            if !self.obey(&mut broadcasts) {
                return;
            }
            self.send(&mut broadcasts);
        }
    }

    /// Does what was ordered; false when nobody can order any more.
    fn obey(&mut self, broadcasts: &mut Vec<Broadcast>) -> bool {
        loop {
            match self.orders.try_recv() {
                Ok(Order::Attend(stream)) => {
                    // One that is gone already is gone, no more.
                    let _ = self.attend(stream);
                }
                Ok(Order::Send(frame)) => broadcasts.push(broadcast(&frame, None)),
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }

    fn attend(&mut self, stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_nonblocking(true)?;
        SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER)?;
        let number = self.next;
        let data = EventData::new_u64(number);
        epoll::add(&self.epoll, &stream, data, EventFlags::IN)?;
        let mut client = Client {
            peer: stream.peer_addr()?,
            stream,
            messages: Messages::default(),
            frames: Frames::None,
            queue: Vec::new(),
            dropped: None,
        };
        client.say("< hi >");
        self.clients.insert(number, client);
        self.next += 1;
        Ok(())
    }

    /// Takes part in the bus whoever has waited long enough for it.
    fn end_pauses(&mut self) {
        let now = Instant::now();
        for (&number, client) in &mut self.clients {
            if matches!(client.frames, Frames::From(from) if from <= now) {
                client.frames = Frames::All;
                client.listen(&self.epoll, number, EventFlags::IN);
            }
        }
    }

    /// Takes what a client says; one that has closed its connection is forgotten.
    fn hear(&mut self, number: u64, broadcasts: &mut Vec<Broadcast>) {
        let Some(client) = self.clients.get_mut(&number) else {
            return;
        };
        let mut bytes = [0; 4096];
        match client.stream.read(&mut bytes) {
            Err(error) if is_later(&error) => {}
            Ok(0) | Err(_) => {
                // Closing it takes it out of the epoll too.
                self.clients.remove(&number);
            }
            // Said by one that is told good-bye.
            Ok(_) if client.dropped.is_some() => {}
            Ok(length) => {
                let mut messages = std::mem::take(&mut client.messages);
                messages.push(&bytes[..length], |message| {
                    if let Some(frame) = client.answer(message, &self.bus) {
                        // A full channel loses the frame, as a full bus would.
                        let _ = self.inlet.try_send((realtime::now(), frame));
                        broadcasts.push(broadcast(&frame, Some(number)));
                    }
                });
                client.messages = messages;
                if let Frames::From(_) = client.frames {
                    client.listen(&self.epoll, number, EventFlags::empty());
                }
            }
        }
    }

    /// Sends to each client in one call what it is to have; drops who is too far behind.
    fn send(&mut self, broadcasts: &mut Vec<Broadcast>) {
        let now = Instant::now();
        self.clients.retain(|&number, client| {
            if client.dropped.is_none() && client.frames == Frames::All {
                let others = broadcasts.iter().filter(|it| it.from != Some(number));
                others.for_each(|it| client.queue.extend_from_slice(it.message.as_bytes()));
            }
            let open = client.flush();
            if open && client.dropped.is_none() && client.queue.len() > QUEUE {
                client.drop(now);
                let told = format!(
                    "{}: client {} reads too slowly: dropped",
                    self.bus, client.peer
                );
                let _ = self.tell.send(told);
            }
            open && client
                .dropped
                .is_none_or(|end| now < end && !client.queue.is_empty())
        });
        broadcasts.clear();
    }
}

fn broadcast(frame: &Frame, from: Option<u64>) -> Broadcast {
    let time = SystemTime::now().duration_since(UNIX_EPOCH);
    Broadcast {
        from,
        message: frame_message(frame, time.unwrap_or_default()),
    }
}

/// Nothing to read or no room to write now, no more.
fn is_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Which frames a client gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Frames {
    /// None before raw mode.
    None,
    /// None until then, in the pause at the beginning of raw mode; nor is it listened to.
    From(Instant),
    /// All.
    All,
}

/// A client.
struct Client {
    peer: SocketAddr,
    stream: TcpStream,
    messages: Messages,
    frames: Frames,
    /// What its connection has not taken yet; it may begin inside a message.
    queue: Vec<u8>,
    /// Too slow: until when the connection may take its last message.
    dropped: Option<Instant>,
}

impl Client {
    /// Something happens here with time, whatever others do.
    fn waits(&self) -> bool {
        !self.queue.is_empty() || matches!(self.frames, Frames::From(_))
    }

    /// Has the epoll tell of what it says, or not for now.
    fn listen(&self, epoll: &OwnedFd, number: u64, what: EventFlags) {
        // It fails for a connection only that is not in there, and it is.
        let _ = epoll::modify(epoll, &self.stream, EventData::new_u64(number), what);
    }

    /// Answers a message; hands over the frame that it brings.
    fn answer(&mut self, message: &str, bus: &str) -> Option<Frame> {
        let mut words = message.split_ascii_whitespace();
        match words.next() {
            Some("open") if words.next() == Some(bus) => self.say("< ok >"),
            Some("open") => self.say("< error could not open bus >"),
            Some("rawmode") => {
                self.say("< ok >");
                self.frames = Frames::From(Instant::now() + PAUSE);
            }
            Some("send") => {
                let frame = parse_send(words);
                if frame.is_none() {
                    self.say("< error invalid frame >");
                }
                return frame;
            }
            Some("echo") => self.say("< echo >"),
            _ => self.say("< error unknown command >"),
        }
        None
    }

    /// Says something in a segment of its own, if it can.
    fn say(&mut self, message: &str) {
        self.queue.extend_from_slice(message.as_bytes());
        // One that is gone is seen when it is read from or sent to next.
        self.flush();
    }

    /// Writes what the connection takes now; false if it is broken.
    fn flush(&mut self) -> bool {
        let mut sent = 0;
        let open = loop {
            if sent == self.queue.len() {
                break true;
            }
            match self.stream.write(&self.queue[sent..]) {
                Ok(0) => break false,
                Ok(count) => sent += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => break error.kind() == ErrorKind::WouldBlock,
            }
        };
        self.queue.drain(..sent);
        open
    }

    /// Leaves out what waits, to the end of the message that is on its way, and says why.
    fn drop(&mut self, now: Instant) {
        let end = self.queue.iter().position(|&byte| byte == b'>');
        self.queue.truncate(end.map_or(0, |end| end + 1));
        self.queue.extend_from_slice(TOO_SLOW.as_bytes());
        self.dropped = Some(now + TIMEOUT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use socket2::{Domain, Socket, Type};
    use syncline_canopen::{CobId, NodeId};

    /// Clients that listen, and clients that do not.
    const LISTEN: usize = 50;
    const STUCK: usize = 10;
    /// Frames in a round.
    const FRAMES: usize = 100;
    /// Far more rounds than fill all that is kept for a client.
    const ROUNDS: usize = 10_000;
    /// Nothing takes that long but what waits.
    const WAITS: Duration = Duration::from_secs(60);

    /// A client that takes part in the bus; `window` makes its receive buffer as small as the kernel lets it be.
    fn client(server: &mut Server, window: Option<usize>) -> TcpStream {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let socket = Socket::new(Domain::IPV4, Type::STREAM, None).unwrap();
        if let Some(bytes) = window {
            socket.set_recv_buffer_size(bytes).unwrap();
        }
        let address = listener.local_addr().unwrap();
        socket.connect(&address.into()).unwrap();
        server.attend(listener.accept().unwrap().0).unwrap();
        let mut last = server.clients.last_entry().unwrap();
        last.get_mut().frames = Frames::All;
        let mut stream = TcpStream::from(socket);
        stream.set_read_timeout(Some(WAITS)).unwrap();
        let mut hi = [0; 6];
        stream.read_exact(&mut hi).unwrap();
        stream
    }

    /// Rounds until all that do not read are dropped: how many clients are left.
    fn rounds() -> usize {
        let (inlet, _frames) = NetworkBus::inlet();
        let (tell, told) = channel::unbounded();
        let (mut server, _orders) = Server::new("can0", inlet, tell).unwrap();
        let stuck: Vec<_> = (0..STUCK).map(|_| client(&mut server, Some(1))).collect();
        let mut listen: Vec<_> = (0..LISTEN).map(|_| client(&mut server, None)).collect();
        let beat = Frame::new(CobId::error_control(NodeId::MAX), &[5]);
        for _ in 0..ROUNDS {
            let mut broadcasts: Vec<_> = (0..FRAMES).map(|_| broadcast(&beat, None)).collect();
            let all: String = broadcasts.iter().map(|it| it.message.as_str()).collect();
            server.send(&mut broadcasts);
            for stream in &mut listen {
                let mut bytes = vec![0; all.len()];
                stream.read_exact(&mut bytes).unwrap();
                assert_eq!(bytes, all.as_bytes());
            }
            let most = server.clients.values().map(|it| it.queue.len()).max();
            assert!(most <= Some(QUEUE), "{most:?} bytes wait");
            if told.len() == STUCK {
                break;
            }
        }
        assert_eq!(told.len(), STUCK, "those that do not read are told of");
        drop(stuck);
        server
            .clients
            .values()
            .filter(|it| it.dropped.is_none())
            .count()
    }

    /// In each round whoever listens has all that came in it, however many do not read; those are dropped once too much waits for
    /// them, and in no round anybody is waited for.
    #[test]
    fn a_round_gives_everyone_its_frames_and_waits_for_none() {
        let (done, rounds_over) = channel::bounded(1);
        thread::spawn(move || done.send(rounds()));
        assert_eq!(rounds_over.recv_timeout(WAITS), Ok(LISTEN));
    }
}

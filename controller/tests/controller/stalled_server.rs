//! A socketcand server that accepts a connection and then does not read.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};
use syncline_canopen::{CanId, Frame};
use syncline_controller::bus::{BURST_CAPACITY, Burst};
use syncline_controller::port::Port as _;
use syncline_controller::port::url::{BusUrl, End};
use syncline_controller::port::wire::WirePort;

/// Greets a client.
fn accept(listener: &TcpListener) -> TcpStream {
    let (mut stream, _) = listener.accept().unwrap();
    stream.write_all(b"< hi >").unwrap();
    for request in ["< open can0 >", "< rawmode >"] {
        let mut bytes = vec![0; request.len()];
        stream.read_exact(&mut bytes).unwrap();
        assert_eq!(bytes, request.as_bytes());
        stream.write_all(b"< ok >").unwrap();
    }
    stream
}

#[test]
fn a_server_that_does_not_read_stops_no_cycle_and_one_that_is_gone_is_told() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("socketcand://{}/can0", listener.local_addr().unwrap());
    let server = std::thread::spawn(move || accept(&listener));
    let url: BusUrl = url.parse().unwrap();
    let mut port = WirePort::new(url.open(1_000_000, End::Client).unwrap());
    let mut stream = server.join().unwrap();

    let frame = Frame::new(CanId::Standard(0x301), &[1, 2, 3, 4, 5, 6, 7, 8]);
    let burst = [frame; BURST_CAPACITY];
    let mut queued = 0;
    while port.send_burst(&burst).unwrap() == Burst::Queued {
        queued += burst.len();
        assert!(queued < 10_000_000, "the server does not read");
    }
    assert_eq!(port.send_burst(&burst).unwrap(), Burst::Dropped);
    assert!(port.send_sync(&frame).is_err());
    port.receive(&mut |_| ()).unwrap();

    // All that was queued and nothing else arrives, up to what waits here.
    stream
        .set_read_timeout(Some(Duration::from_millis(200)))
        .unwrap();
    let message = b"< send 301 8 1 2 3 4 5 6 7 8 >";
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes);
    assert!(
        bytes
            .chunks(message.len())
            .all(|it| message.starts_with(it))
    );
    assert_eq!(port.send_burst(&[frame]).unwrap(), Burst::Queued);
    let _ = stream.read_to_end(&mut bytes);
    assert_eq!(bytes.len(), (queued + 1) * message.len());

    drop(stream);
    let until = Instant::now() + Duration::from_secs(10);
    while port.receive(&mut |_| ()).is_ok() {
        assert!(Instant::now() < until, "a closed connection is told");
        std::thread::sleep(Duration::from_millis(1));
    }
}

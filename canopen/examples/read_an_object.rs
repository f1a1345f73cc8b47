//! A client reads an object of a device over SDO, without a bus: whoever calls carries the frames.
//! `cargo run -p syncline-canopen --example read_an_object`

use std::error::Error;
use syncline_canopen::dictionary::{DataType::U32, Dictionary, Entry, ro, table};
use syncline_canopen::sdo::{Client, Server};
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CobId, Frame, Instant, NodeId};

/// What the device has: index, sub-index, name, type and value.
static OBJECTS: [Entry; 2] = table([
    ro(0x1000, 0, "Device type", U32).default(0x0042_0192),
    ro(0x1018, 1, "Vendor id", U32).default(0x0800_005A),
]);

fn main() -> Result<(), Box<dyn Error>> {
    let node = NodeId::new(3).ok_or("a node id is 1…127")?;
    let mut objects = Dictionary::new(&OBJECTS, node);
    let mut server = Server::new(CobId::r_sdo(node), CobId::t_sdo(node), 8);
    let mut client = Client::new(node, Duration::from_millis(100), 8);

    // A protocol is handed the present instant and where its frames go; it never waits.
    let now = Instant::ZERO;
    let (mut requests, mut answers): (Vec<Frame>, Vec<Frame>) = (Vec::new(), Vec::new());
    client.upload(now, Address::new(0x1018, 1), &mut requests)?;
    for request in &requests {
        println!("client  {request:?}");
        server.on_frame(now, request, &mut objects, &mut answers);
    }
    let mut vendor = None;
    for answer in &answers {
        println!("server  {answer:?}");
        if let Some(result) = client.on_frame(now, answer, &mut Vec::new()) {
            vendor = Some(u32::from_le_bytes(result?.try_into()?));
        }
    }
    println!(
        "1018h:1 of node {node} is {:08X}h",
        vendor.ok_or("no answer")?
    );
    assert_eq!(vendor, Some(0x0800_005A));
    Ok(())
}

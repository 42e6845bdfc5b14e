//! Connections.

use super::{door, lists, with_key};
use crate::support::{Service, ask, assert_refused};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tonic::Code;
use yoto_proto::v1::Scope;

/// What strangers send: nothing; the beginning of HTTP/2; the beginning of a request, which has no end.
const BEGINNINGS: [&[u8]; 3] = [
    b"",
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0",
    b"GET / HTTP/1.1\r\nHost: x\r\nX: ",
];

#[tokio::test]
async fn strangers_who_open_connections_and_ask_nothing_keep_nobody_out() {
    let service = Service::start_with(|config| config.traffic.waiting_connections = 16).await;
    let key = service.key("default", &[Scope::Read]).await;
    let address = door(&service).await;
    let early = with_key(address, &key).await;
    lists(&early).await.expect("comes first");
    for beginning in BEGINNINGS {
        let mut strangers = Vec::new();
        for _ in 0..100 {
            let mut stranger = TcpStream::connect(address).await.expect("connects");
            // The connection may have ended already.
            let _ = stranger.write_all(beginning).await;
            strangers.push(stranger);
        }
        lists(&with_key(address, &key).await)
            .await
            .expect("a newcomer with a key");
        lists(&early).await.expect("who was there before");
        assert_eq!(ask(address, "GET", "/readyz").await.0, 200);
    }
}

#[tokio::test]
async fn connections_of_one_key_keep_out_no_other_key_from_the_same_address() {
    let service = Service::start_with(|config| config.traffic.connections = 30).await;
    let greedy = service.key("greedy", &[Scope::Read]).await;
    let other = service.key("other", &[Scope::Read]).await;
    let address = door(&service).await;
    let mut open = Vec::new();
    loop {
        let connection = with_key(address, &greedy).await;
        match lists(&connection).await {
            Ok(()) => open.push(connection),
            Err(status) => {
                break assert_refused::<()>(Err(status), Code::Unavailable, "BUSY");
            }
        }
    }
    assert_eq!(open.len(), 10, "a third");
    lists(&with_key(address, &other).await)
        .await
        .expect("another tenant");
    assert_eq!(ask(address, "GET", "/readyz").await.0, 200);
}

#[tokio::test]
async fn a_stranger_is_let_go_after_a_while_and_a_caller_stays() {
    let service = Service::start_with(|config| {
        config.traffic.first_call = Duration::from_millis(300);
    })
    .await;
    let key = service.key("default", &[Scope::Read]).await;
    let address = door(&service).await;
    let caller = with_key(address, &key).await;
    lists(&caller).await.expect("is admitted");
    for beginning in BEGINNINGS {
        let mut stranger = TcpStream::connect(address).await.expect("connects");
        stranger.write_all(beginning).await.expect("writes");
        let begun = Instant::now();
        let mut read = Vec::new();
        let ended = stranger.read_to_end(&mut read);
        let ended = tokio::time::timeout(Duration::from_secs(20), ended).await;
        assert!(ended.is_ok(), "is open after {:?}", begun.elapsed());
    }
    lists(&caller).await.expect("stays");
}

//! A token of a list's page: one of this list with this filter that leads to a position, or an error.
#![no_main]

// The server's pages need no server: its source is a module here.
#[path = "../../../server/src/api/paging.rs"]
mod paging;

use libfuzzer_sys::fuzz_target;
use paging::Request;
use yoto_proto::v1::Job;
use yoto_store::Entry;

fuzz_target!(|input: (i32, i64, &str)| {
    let (size, position, token) = input;
    let owned = |owner: &str| Job {
        owner: owner.into(),
        ..Job::default()
    };
    let (filter, other) = (owned("lab"), owned("press"));
    // A token that a page makes leads behind the page's last entry, in this list alone.
    let Ok(first) = Request::read("jobs", size, "", &filter) else {
        assert!(size < 0);
        return;
    };
    let limit = first.page().limit;
    assert!(first.page().after.is_none() && (2..=1001).contains(&limit));
    let positions = (1..limit).map(|_| 0).chain([position, 0]);
    let positions = positions.skip(1).map(|position| Entry {
        position,
        item: Job::default(),
    });
    let (items, made) = first.cut(positions.collect());
    assert_eq!(items.len() + 1, limit as usize);
    let next = Request::read("jobs", size, &made, &filter).expect("its own token");
    assert_eq!(next.page().after, Some(position));
    assert!(Request::read("jobs", size, &made, &other).is_err());
    assert!(Request::read("models", size, &made, &filter).is_err());
    // A token of a stranger.
    if let Ok(page) = Request::read("jobs", size, token, &filter) {
        assert_eq!(page.page().after.is_none(), token.is_empty());
        assert!(page.of_all(vec![Job::default(); 3]).len() <= 3);
        assert!(token.is_empty() || Request::read("jobs", size, token, &other).is_err());
    }
});

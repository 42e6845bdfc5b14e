//! Pages of lists: sizes, opaque tokens, and a limit on a page's bytes.

use prost::Message;
use yoto_proto::limits::{LONGEST_PAGE_ENTRIES, PAGE_BYTES, PAGE_ENTRIES};
use yoto_proto::{hex, sha256_hex};
use yoto_request::RequestError;
use yoto_store::{Entry, Page};

/// Characters of a filter's digest, of 4 bits each.
const DIGEST: usize = 16;

/// The page of a list call.
pub(super) struct Request {
    /// Name of the list, and digest of its filter: the beginning of its tokens.
    list: String,
    size: u32,
    after: Option<i64>,
}

impl Request {
    /// Reads `page_size` and `page_token` of a call on `list`. A token is one of this list with the same `filter`: the rest
    /// of the request.
    pub(super) fn read(
        list: &str,
        size: i32,
        token: &str,
        filter: &impl Message,
    ) -> Result<Self, RequestError> {
        let mut digest = sha256_hex(&filter.encode_to_vec());
        digest.truncate(DIGEST);
        let list = format!("{list}:{digest}");
        let size = u32::try_from(size)
            .map_err(|_| RequestError::invalid("page_size", format!("{size} is below 0")))?;
        let size = if size == 0 {
            PAGE_ENTRIES
        } else {
            size.min(LONGEST_PAGE_ENTRIES)
        };
        let after = match token {
            "" => None,
            token => Some(position(&list, token).ok_or_else(|| {
                let message = "is not a token of this list with this filter";
                RequestError::invalid("page_token", message)
            })?),
        };
        Ok(Self { list, size, after })
    }

    /// Query of the store: one entry more than requested shows whether another page follows.
    pub(super) fn page(&self) -> Page {
        Page {
            limit: self.size + 1,
            after: self.after,
        }
    }

    /// Entries from this page on, of a list that is read as a whole.
    pub(super) fn of_all<T>(&self, all: Vec<T>) -> Vec<Entry<T>> {
        let entries = (1_i64..).zip(all);
        let entries = entries.map(|(position, item)| Entry { position, item });
        let after = self.after.unwrap_or(0);
        entries
            .skip_while(|entry| entry.position <= after)
            .take(self.size as usize + 1)
            .collect()
    }

    /// The page's entries, and the next page's token (empty after the last).
    pub(super) fn cut<T: Message>(&self, entries: Vec<Entry<T>>) -> (Vec<T>, String) {
        let mut items = Vec::with_capacity(entries.len());
        let (mut bytes, mut last) = (0, 0);
        for entry in entries {
            bytes += entry.item.encoded_len();
            let full = items.len() >= self.size as usize || bytes > PAGE_BYTES;
            if full && !items.is_empty() {
                return (items, hex(format!("{}:{last}", self.list).as_bytes()));
            }
            last = entry.position;
            items.push(entry.item);
        }
        (items, String::new())
    }
}

/// The position in a token, which is the hex of `list:digest:position`.
fn position(list: &str, token: &str) -> Option<i64> {
    let text = String::from_utf8(hex::decode(token)?).ok()?;
    text.strip_prefix(list)?.strip_prefix(':')?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::Job;

    #[test]
    fn a_token_leads_behind_the_last_entry_of_its_own_list_only() {
        let filter = Job {
            owner: "lab".into(),
            ..Job::default()
        };
        let request = Request::read("jobs", 2, "", &filter).expect("a good request");
        let entries = (1..=request.page().limit).map(|n| Entry {
            position: i64::from(n),
            item: Job {
                name: format!("jobs/{n}"),
                ..Job::default()
            },
        });
        let (items, token) = request.cut(entries.collect());
        assert_eq!(items.len(), 2);
        let next = Request::read("jobs", 2, &token, &filter).expect("its own token");
        assert_eq!(next.page().after, Some(2));
        assert!(Request::read("models", 2, &token, &filter).is_err());
        let other = Job::default();
        assert!(Request::read("jobs", 2, &token, &other).is_err());
        for bad in ["x", "ü", "6a", "zz", &"0".repeat(999)] {
            assert!(Request::read("jobs", 2, bad, &filter).is_err(), "{bad}");
        }
        assert!(Request::read("jobs", -1, "", &filter).is_err());
    }
}

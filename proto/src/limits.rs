//! The limits on which both sides of the contract agree. Limits of one side alone, such as those of
//! pictures that a worker decodes, stand with that side.

/// Longest gRPC message that either side takes, bytes. A list of views or of a capture's files is longer
/// than the usual limit of 4 MiB.
pub const MESSAGE_BYTES: usize = 16 << 20;
/// Longest answer that a client or worker takes, bytes: a job holds its order and its result, and a lease an
/// order and the files of its capture, and each of these may have come in its own message.
pub const ANSWER_BYTES: usize = 2 * MESSAGE_BYTES;
/// Bytes on their way in a stream or connection before the receiver has read some of them.
pub const WINDOW_BYTES: u32 = MESSAGE_BYTES as u32;
/// Concurrent calls on one connection. A client that follows many jobs has one call for each.
pub const STREAMS: u32 = 1024;

/// Bytes of an upload that are committed at once, as one object.
pub const PART_BYTES: u64 = 8 << 20;
/// Files that are committed at once.
pub const PART_FILES: usize = 1024;
/// A part smaller than this fraction of a full one is joined to the next one. An upload whose connection breaks after each
/// byte then has at most 8,193 parts of 1 MiB, and each of its commits writes up to 1 MiB again.
pub const LEAST_PART: u64 = 8;
/// Pieces of the files of an upload. One for each file, and one more where a part ends within a file, are far fewer.
pub const UPLOAD_PIECES: u64 = 2 * CAPTURE_FILES as u64;
/// Parts of an upload whose URLs one call asks for.
pub const SIGNED_PARTS: usize = 16;
/// Bytes of one chunk of a transfer: far below a message, and enough for full speed.
pub const CHUNK_BYTES: usize = 256 << 10;
/// Bytes of one uploaded file.
pub const FILE_BYTES: u64 = 8 << 30;
/// Bytes of all files of an upload.
pub const CAPTURE_BYTES: u64 = 8 << 30;
/// Number of files of an upload.
pub const CAPTURE_FILES: usize = 200_000;
/// Bytes of the list of uploaded files, each in one piece, in a lease.
pub const LISTING_BYTES: usize = MESSAGE_BYTES - (1 << 20);
/// Bytes that a piece of a file and its part add to a lease at most: tags, lengths and numbers of a piece.
pub const PIECE_LISTING_BYTES: usize = 20;
/// Length of a file's path in an upload, bytes.
pub const PATH_BYTES: usize = 200;

/// Length of a display name, bytes.
pub const DISPLAY_NAME_BYTES: usize = 200;
/// A file that proves a consent, bytes: it fits into a message.
pub const EVIDENCE_BYTES: usize = 3 << 20;
/// Its name, bytes.
pub const EVIDENCE_NAME_BYTES: usize = 255;
/// Length of a consent note, bytes.
pub const CONSENT_NOTE_BYTES: usize = 10_000;
/// Length of the owner of a job, characters.
pub const OWNER_CHARACTERS: usize = 80;
/// Length of the reason of a pause, characters.
pub const REASON_CHARACTERS: usize = 500;
/// Length of a request id, bytes.
pub const REQUEST_ID_BYTES: usize = 128;

/// Entries per page if the request gives no size.
pub const PAGE_ENTRIES: u32 = 100;
/// Entries of the largest page.
pub const LONGEST_PAGE_ENTRIES: u32 = 1000;
/// A page of several entries stays below this, bytes.
pub const PAGE_BYTES: usize = MESSAGE_BYTES / 2;

/// Most violations that are kept for one capture or request; more would not help its owner.
pub const VIOLATIONS: usize = 100;
/// Length of one text from a worker, such as a message of an error, bytes.
pub const WORKER_TEXT_BYTES: usize = 4096;
/// Maximum length of one line from a worker, such as a note, bytes.
pub const WORKER_LINE_BYTES: usize = 500;
/// Maximum number of lines in a list from a worker, such as the notes of a training.
pub const WORKER_LINES: usize = 100;
/// Maximum length of a job's result without its files, bytes.
pub const RESULT_BYTES: usize = 1 << 20;

/// The beginning of `text`, of at most `bytes` bytes, cut between characters.
pub fn beginning(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_between_characters() {
        assert_eq!(beginning("größe", 4), "grö");
        assert_eq!(beginning("größe", 3), "gr");
        assert_eq!(beginning("größe", 99), "größe");
    }

    #[test]
    fn a_list_of_files_leaves_room_in_its_message() {
        const { assert!(LISTING_BYTES < MESSAGE_BYTES && PAGE_BYTES < MESSAGE_BYTES) }
        const { assert!(LISTING_BYTES + UPLOAD_PIECES as usize * PIECE_LISTING_BYTES < ANSWER_BYTES) }
        const { assert!(CHUNK_BYTES < PART_BYTES as usize && PART_BYTES < MESSAGE_BYTES as u64) }
    }
}

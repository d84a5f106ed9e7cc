//! Pieces of a stage's result that are computed one after the other and kept in a file as they come: an interrupted stage
//! continues with the first piece that is missing, and its result has the same bits.
//!
//! The order of the pieces, and what each is computed from, depend on the inputs of the stage alone, which the run directory
//! compares; a change of the order in this program needs a new revision of the stage. Where they are computed within a second, no file is written.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use lacuna::run::{Fault, Observer, Stop, files};

/// File of the pieces in the folder of an unfinished stage.
const FILE: &str = "pieces.bin";

/// Interval between writes.
const INTERVAL: Duration = Duration::from_secs(1);

/// Number of bytes of a length, of a number, and of the check of a piece.
const WORD: usize = 8;

/// The pieces of a result, in their order.
pub struct Pieces<'a> {
    /// Pieces that an earlier attempt has left.
    known: std::vec::IntoIter<Vec<f64>>,
    /// Number of pieces so far.
    count: u64,
    log: Option<Log>,
    /// A piece computed after one of these faults has no meaning.
    faults: &'a [Arc<Fault>],
    progress: Option<(&'a dyn Observer, u64)>,
}

/// The file, and the pieces that are not yet in it.
struct Log {
    path: PathBuf,
    file: Option<File>,
    pending: Vec<u8>,
    written: Instant,
}

impl<'a> Pieces<'a> {
    /// The pieces of a stage with this folder: those that an earlier attempt has left, and new ones. The observer is told of
    /// each of them.
    pub fn open(
        folder: &Path,
        faults: &'a [Arc<Fault>],
        observer: &'a dyn Observer,
    ) -> Result<Self, Stop> {
        let path = folder.join(FILE);
        let bytes = fs::read(&path).unwrap_or_default();
        let (known, sound) = read(&bytes);
        let file = (!bytes.is_empty()).then(|| OpenOptions::new().append(true).open(&path));
        let file = file.transpose().map_err(|error| files::cannot_write(&path, &error))?;
        if let Some(file) = &file {
            file.set_len(sound as u64).map_err(|error| files::cannot_write(&path, &error))?;
        }
        let log = Log { path, file, pending: Vec::new(), written: Instant::now() };
        Ok(Self {
            known: known.into_iter(),
            count: 0,
            log: Some(log),
            faults,
            progress: Some((observer, 0)),
        })
    }

    /// Pieces that are kept nowhere.
    pub fn unkept() -> Self {
        Self { known: Vec::new().into_iter(), count: 0, log: None, faults: &[], progress: None }
    }

    /// Announces further pieces.
    pub fn announce(&mut self, further: usize) {
        if let Some((observer, expected)) = &mut self.progress {
            *expected += further as u64;
            observer.expect(*expected);
        }
    }

    /// The next piece: as an earlier attempt has left it, or made.
    pub fn next(
        &mut self,
        make: impl FnOnce() -> Result<Vec<f64>, Stop>,
    ) -> Result<Vec<f64>, Stop> {
        let piece = match self.known.next() {
            Some(piece) => piece,
            None => self.made(make)?,
        };
        self.count += 1;
        if let Some((observer, _)) = self.progress {
            observer.advance(1);
        }
        Ok(piece)
    }

    fn made(&mut self, make: impl FnOnce() -> Result<Vec<f64>, Stop>) -> Result<Vec<f64>, Stop> {
        let piece = make()?;
        if let Some(said) = self.faults.iter().find_map(|fault| fault.said()) {
            return Err(Stop::new(said));
        }
        if let Some(log) = &mut self.log {
            log.append(self.count, &piece)?;
        }
        Ok(piece)
    }

    /// Removes the file: the stage has its result.
    pub fn finish(self) -> Result<(), Stop> {
        let Some(Log { path, file: Some(_), .. }) = self.log else { return Ok(()) };
        fs::remove_file(&path).map_err(|error| files::cannot_write(&path, &error))
    }
}

impl Log {
    fn append(&mut self, index: u64, piece: &[f64]) -> Result<(), Stop> {
        self.pending.extend_from_slice(&(piece.len() as u64).to_le_bytes());
        let begin = self.pending.len();
        self.pending.resize(begin + WORD * piece.len(), 0);
        let (words, _) = self.pending[begin..].as_chunks_mut::<WORD>();
        words.iter_mut().zip(piece).for_each(|(word, value)| *word = value.to_le_bytes());
        let check = check(index, &self.pending[begin..]);
        self.pending.extend_from_slice(&check);
        if self.written.elapsed() < INTERVAL {
            return Ok(());
        }
        self.write().map_err(|error| files::cannot_write(&self.path, &error))
    }

    fn write(&mut self) -> std::io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(OpenOptions::new().create(true).append(true).open(&self.path)?),
        };
        file.write_all(&self.pending)?;
        file.sync_data()?;
        self.pending.clear();
        self.written = Instant::now();
        Ok(())
    }
}

/// Eight characters of the hash of a piece at its place.
fn check(index: u64, values: &[u8]) -> [u8; WORD] {
    let hash = files::hash_parts([&index.to_le_bytes()[..], values]);
    let mut check = [0; WORD];
    check.copy_from_slice(&hash.as_bytes()[..WORD]);
    check
}

/// The pieces in a file up to the first that is cut or damaged, and the number of their bytes.
fn read(bytes: &[u8]) -> (Vec<Vec<f64>>, usize) {
    let (mut pieces, mut rest) = (Vec::new(), bytes);
    while let Some((values, after)) = first(rest, pieces.len() as u64) {
        let (words, _) = values.as_chunks::<WORD>();
        pieces.push(words.iter().map(|&word| f64::from_le_bytes(word)).collect());
        rest = after;
    }
    (pieces, bytes.len() - rest.len())
}

/// Bytes of the values of the first piece, and what follows it.
fn first(bytes: &[u8], index: u64) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<WORD>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?.checked_mul(WORD)?;
    let (values, rest) = rest.split_at_checked(length)?;
    let (stated, rest) = rest.split_first_chunk::<WORD>()?;
    (*stated == check(index, values)).then_some((values, rest))
}

#[cfg(test)]
mod tests {
    use lacuna::run::Silent;

    use super::*;

    /// Three pieces as a file has them.
    fn file() -> (Vec<Vec<f64>>, Vec<u8>) {
        let pieces = vec![vec![1.0, f64::NAN, -0.0], vec![], vec![f64::INFINITY]];
        let mut log = Log {
            path: PathBuf::from("unused"),
            file: None,
            pending: Vec::new(),
            written: Instant::now() + Duration::from_secs(3600),
        };
        for (i, piece) in pieces.iter().enumerate() {
            log.append(i as u64, piece).unwrap();
        }
        (pieces, log.pending)
    }

    fn bits(pieces: &[Vec<f64>]) -> Vec<Vec<u64>> {
        pieces.iter().map(|piece| piece.iter().map(|value| value.to_bits()).collect()).collect()
    }

    #[test]
    fn parts_are_read_as_they_were_written() {
        let (pieces, bytes) = file();
        let (read, sound) = read(&bytes);
        assert_eq!((bits(&read), sound), (bits(&pieces), bytes.len()));
    }

    #[test]
    fn a_part_that_is_cut_or_damaged_is_left_out_with_all_that_follow() {
        let (pieces, bytes) = file();
        let ends: Vec<usize> = pieces
            .iter()
            .scan(0, |end, piece| {
                *end += WORD * (piece.len() + 2);
                Some(*end)
            })
            .collect();
        for cut in 0..bytes.len() {
            let whole = ends.iter().filter(|end| **end <= cut).count();
            let (found, sound) = read(&bytes[..cut]);
            assert_eq!(bits(&found), bits(&pieces[..whole]), "cut at {cut}");
            assert_eq!(sound, if whole == 0 { 0 } else { ends[whole - 1] });
        }
        for place in 0..bytes.len() {
            let whole = ends.iter().filter(|end| **end <= place).count();
            let mut damaged = bytes.clone();
            damaged[place] ^= 0x10;
            assert_eq!(bits(&read(&damaged).0), bits(&pieces[..whole]), "damaged at {place}");
        }
    }

    #[test]
    fn a_part_at_another_place_is_no_part() {
        let (_, bytes) = file();
        assert_eq!(read(&bytes[WORD * 5..]).0.len(), 0);
    }

    #[test]
    fn an_attempt_continues_with_the_first_part_that_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        let (pieces, bytes) = file();
        // The last piece is cut.
        fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let mut attempt = Pieces::open(folder.path(), &[], &Silent).unwrap();
        for piece in &pieces[..2] {
            let found = attempt.next(|| panic!("it is known")).unwrap();
            assert_eq!(bits(&[found]), bits(std::slice::from_ref(piece)));
        }
        assert_eq!(attempt.next(|| Ok(vec![3.0])).unwrap(), [3.0]);
        attempt.log.as_mut().unwrap().write().unwrap();
        assert_eq!(read(&fs::read(&path).unwrap()).0[2], [3.0]);
        attempt.finish().unwrap();
        assert!(!path.exists());
    }

    #[test]
    fn a_part_that_is_computed_after_a_fault_is_neither_used_nor_kept() {
        let folder = tempfile::tempdir().unwrap();
        let faults = [Arc::new(Fault::new("discrepancy `x`"))];
        let mut pieces = Pieces::open(folder.path(), &faults, &Silent).unwrap();
        assert_eq!(pieces.next(|| Ok(vec![1.0])).unwrap(), [1.0]);
        let stop = pieces.next(|| {
            faults[0].report("it is broken");
            Ok(vec![f64::NAN])
        });
        assert_eq!(stop.unwrap_err().message, "discrepancy `x`: it is broken");
        assert_eq!(read(&pieces.log.unwrap().pending).0, [[1.0]]);
    }
}

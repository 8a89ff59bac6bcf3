#pragma once

#include <stdexcept>
#include <string>

namespace mapjoin {

/// Root of everything mapjoin throws on purpose.
///
/// A message names the variable, file and line concerned, says what was expected, and ends with
/// what the reader can do about it. Nothing in the library aborts, and nothing returns NaN instead
/// of throwing.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Data from outside (a file, an argument, a measurement) is not what it has to be.
class InputError : public Error {
 public:
  using Error::Error;
};

/// A file cannot be opened, read or written.
class FileError : public Error {
 public:
  using Error::Error;
};

/// An anchor does not fix a frame: its features coincide, are collinear, or are not in the map.
class DegenerateFrameError : public Error {
 public:
  using Error::Error;
};

/// Maps that were to be joined share too little to be placed relative to each other.
class DisconnectedError : public Error {
 public:
  using Error::Error;
};

/// A linear system is not positive definite: some variable is not determined by the information
/// given.
class SingularError : public Error {
 public:
  using Error::Error;
};

/// The caller's progress callback asked to stop.
class CancelledError : public Error {
 public:
  using Error::Error;
};

}  // namespace mapjoin

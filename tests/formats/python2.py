"""Pickles of Python 2: its str is bytes, in instructions that Python 3 no longer uses."""

import io
import pickle


class Pickler(pickle._Pickler):
    """Protocols 0 and 2. Text and bytes both become Python 2's str."""

    dispatch = dict(pickle._Pickler.dispatch)

    def save_str2(self, obj):
        data = obj.encode("latin1") if isinstance(obj, str) else bytes(obj)
        if self.proto == 0:
            self.write(b"S" + repr(data)[1:].encode("ascii") + b"\n")
        elif len(data) < 256:
            self.write(b"U" + bytes([len(data)]) + data)
        else:
            self.write(b"T" + len(data).to_bytes(4, "little") + data)
        self.memoize(obj)

    dispatch[str] = save_str2
    dispatch[bytes] = save_str2

    def save_global(self, obj, name=None):
        # numpy 2 renamed numpy.core, the module in Python 2's numpy.
        module = getattr(obj, "__module__", None) or "numpy"
        name = name or obj.__qualname__
        moved = {
            "numpy._core.multiarray": "numpy.core.multiarray",
            "copyreg": "copy_reg",
            "builtins": "__builtin__",
            "scipy.sparse._csc": "scipy.sparse.csc",
        }
        self.write(b"c" + moved.get(module, module).encode() + b"\n" + name.encode() + b"\n")
        self.memoize(obj)

    for kind in (type, type(len), type(lambda: 0)):
        dispatch[kind] = save_global


def dumps(obj, protocol):
    out = io.BytesIO()
    Pickler(out, protocol, fix_imports=True).dump(obj)
    return out.getvalue()

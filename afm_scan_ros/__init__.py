"""Makes a piezoscanner follow its scan by inverting creep, hysteresis and vibration."""

__path__ = __import__("pkgutil").extend_path(__path__, __name__)

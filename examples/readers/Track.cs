// var track = Track.Read("film.json");  colour *= track.ScaleAt(seconds);
using System;
using System.IO;
using System.Runtime.Serialization.Json;

public class Track {
    public double[] times_s, factors;
    public double gamma;
    public static Track Read(string path) { // in Unity: JsonUtility.FromJson<Track>(text), on a [Serializable] class
        using (var file = File.OpenRead(path))
            return (Track)new DataContractJsonSerializer(typeof(Track)).ReadObject(file);
    }
    public double FactorAt(double time) { // of the last frame that begins no later; before the first, of the first
        int found = Array.BinarySearch(times_s, time);
        return factors[Math.Max(found >= 0 ? found : ~found - 1, 0)];
    }
    public double ScaleAt(double time) { return Math.Pow(FactorAt(time), 1 / gamma); } // of gamma-encoded values
}
